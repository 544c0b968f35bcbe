"""The simulated robot as an FMU has it: variables, model and matrices."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import mujoco
import numpy as np

from engines.mujoco.arms.readings import Readings
from engines.mujoco.arms.servos import ServoLaw, Servos
from engines.mujoco.model import place, spec, ties
from engines.mujoco.params import MujocoParams
from engines.mujoco.ports import GRAVITY, scene_ports
from robots.dvrk.mounted.mounted_arm import MountedArm
from schemas.errors import ScenarioError
from schemas.ports import Port
from schemas.ros import JointState, PoseStamped
from schemas.vectors import Vector

__all__ = ["Robot", "Variable"]

_UNITS: Mapping[str, tuple[str, str]] = {
    "position": ("rad", "m"),
    "velocity": ("rad/s", "m/s"),
    "effort": ("N*m", "N"),
}
"""Units of a revolute and of a prismatic joint."""
_POSE = tuple(f"position.{axis}" for axis in "xyz") + tuple(f"orientation.{axis}" for axis in "xyzw")
_WRENCH = tuple((what, axis) for what in ("force", "torque") for axis in "xyz")


@dataclass(frozen=True)
class Variable:
    """A variable of the FMU, a double."""

    name: str
    unit: str
    description: str
    causality: Literal["input", "parameter", "output"]
    start: float
    limits: tuple[float, float] | None = None


class Robot:
    """The robot of a scene at its start."""

    def __init__(self, params: MujocoParams, period_ns: int) -> None:
        """Build the model. Raises ScenarioError for a scene with more than arms under position servos."""
        _check(params, period_ns)
        self.params, self.period_ns = params, period_ns
        self.sub_steps = period_ns // params.timestep
        uncompiled = spec(params)
        ties.add(uncompiled, params)
        uncompiled.option.timestep = params.timestep * 1e-9
        self.model = uncompiled.compile()
        self._data = mujoco.MjData(self.model)
        place(self.model, self._data, params.arms)
        self._servos = Servos(self.model, self._data, params.arms, period_ns * 1e-9)
        mujoco.mj_forward(self.model, self._data)
        self._readings = Readings(self.model, self._data, params.arms, self._servos)
        self._readings.refresh()
        self._slides: dict[str, frozenset[str]] = {arm: _slides(one) for arm, one in params.arms.items()}
        self.physics = self._state()
        """MuJoCo's integration state at the start."""
        self._ports = [port for port in scene_ports(params) if port.name in self._readings.outputs]
        start = {port.name: self._readings.outputs[port.name].copy() for port in self._ports}
        self.inputs = [*self._commands(), *self._wrenches()]
        self.outputs = [
            replace(variable, start=float(value))
            for port in self._ports
            if port.name != "qpos"
            for variable, value in zip(self._read_variables(port), start[port.name], strict=True)
        ]

    @property
    def law(self) -> ServoLaw:
        """Numbers of the servos."""
        return self._servos.law

    @property
    def gravity(self) -> Variable:
        """The parameter that may change while the FMU runs."""
        (port,) = (port for port in scene_ports(self.params) if port.name == GRAVITY)
        assert port.start is not None
        assert port.limits is not None
        return Variable(GRAVITY, port.unit, port.description, "parameter", port.start[0], port.limits)

    @property
    def variables(self) -> list[Variable]:
        """All variables in the order of their value references, from 0."""
        return [*self.inputs, self.gravity, *self.outputs]

    def reading(self) -> Vector:
        """Return the matrix from MuJoCo's sensors and the setpoints to the outputs."""
        sensors, setpoint = self._data.sensordata, self._servos.setpoint
        before = sensors.copy(), setpoint.copy()
        matrix = np.zeros((len(self.outputs), sensors.size + setpoint.size))
        sensors[:] = setpoint[:] = 0.0
        for column in range(matrix.shape[1]):
            source, i = (sensors, column) if column < sensors.size else (setpoint, column - sensors.size)
            source[i] = 1.0
            self._readings.update()
            self._readings.refresh()
            outputs = self._readings.outputs
            matrix[:, column] = np.concatenate([outputs[p.name] for p in self._ports if p.name != "qpos"])
            source[i] = 0.0
        sensors[:], setpoint[:] = before
        return matrix

    def _state(self) -> Vector:
        whole = int(mujoco.mjtState.mjSTATE_INTEGRATION)
        state = np.empty(mujoco.mj_stateSize(self.model, whole))
        mujoco.mj_getState(self.model, self._data, state, whole)
        return state

    def _commands(self) -> Iterator[Variable]:
        """Yield the goals of the servos, in the order of the drives."""
        for port in scene_ports(self.params):
            if port.name.endswith("/servo_jp"):
                assert port.start is not None
                for variable, start in zip(self._joint_variables(port, "input"), port.start, strict=True):
                    yield replace(variable, start=start)

    def _wrenches(self) -> Iterator[Variable]:
        for arm in self.params.arms:
            for what, axis in _WRENCH:
                about = f"{what} on the instrument at its tip, along {axis} of {arm}_base"
                unit = {"force": "N", "torque": "N*m"}[what]
                yield Variable(f"{arm}.tip_{what}.{axis}", unit, about, "input", 0.0)

    def _read_variables(self, port: Port) -> Iterator[Variable]:
        name = port.name.replace("/", ".")
        if port.type == PoseStamped.ros_type:
            for part in _POSE:
                unit = "m" if part.startswith("position") else ""
                yield Variable(f"{name}.{part}", unit, f"pose of the tip in {port.frame}", "output", 0.0)
        elif port.type == JointState.ros_type:
            yield from self._joint_variables(port, "output")

    def _joint_variables(self, port: Port, causality: Literal["input", "output"]) -> Iterator[Variable]:
        """Yield the variables of a port; the field is in the name where the port has several."""
        slides = self._slides[port.name.partition("/")[0]]
        several = len(port.fields) > 1
        for field in port.fields:
            for joint in port.names:
                parts = [*port.name.split("/"), *([field] if several else []), joint]
                unit = _UNITS[field][joint in slides]
                about = port.description or f"{field} of {joint}"
                yield Variable(".".join(parts), unit, about, causality, 0.0)


def _slides(arm: MountedArm) -> frozenset[str]:
    """Return the names of the prismatic joints of an arm with its end effector."""
    joints = (*arm.chain.joints, *arm.commanded_end_effector.joints, *arm.end_effector_links)
    return frozenset(joint.name for joint in joints if joint.kind == "prismatic")


def _check(params: MujocoParams, period_ns: int) -> None:
    """Refuse what an FMU of the robot has not."""
    spares = [name for name, arm in params.arms.items() if len(arm.variants) > 1]
    problems = {
        "objects, fixtures and a table": bool(params.objects or params.fixtures or params.table),
        f"spare instruments ({', '.join(spares)})": bool(spares),
        "bonded joints": bool(params.bonded_joints),
        "a lean model": params.lean,
        "measured_effort: motor": params.measured_effort != "servo",
    }
    if found := [problem for problem, is_so in problems.items() if is_so]:
        raise ScenarioError(
            f"an FMU of the robot has arms with one instrument each under position servos, not"
            f" {' or '.join(found)}; leave it out"
        )
    if period_ns % params.timestep:
        raise ScenarioError(
            f"the FMU's step of {period_ns / 1e6:g} ms is no multiple of the physics' sub-step of"
            f" {params.timestep / 1e6:g} ms"
        )
