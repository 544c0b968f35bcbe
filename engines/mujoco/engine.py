"""The MuJoCo engine: dVRK arms with joint servos, a power bond at each probe, and exact checkpoints.

A sub-step is `mj_step2` (actuation to integration) followed by `mj_step1` (kinematics, velocities, sensors): the same
work as `mj_step`, in the order that leaves every output at the end of the step instead of one sub-step behind.
"""

from __future__ import annotations

import logging
from importlib.util import find_spec
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from engines.mujoco.params import MujocoParams, PsmParams
from hub.bond import MotionSide
from hub.inputs import Inputs
from hub.participant import Outputs, Params, Setup, Stepped, Value, state_hash
from robots.dvrk import psm
from schemas.errors import MissingExtraError, ScenarioError, SessionError, StateError
from schemas.ports import BondSide, Port

if TYPE_CHECKING:
    from engines.mujoco.arm import RunningArm

__all__ = ["MujocoEngine"]

_JOINT_STATE = "sensor_msgs/msg/JointState"


class MujocoEngine(Stepped):
    """dVRK arms in a rigid world."""

    params_model: ClassVar[type[Params]] = MujocoParams
    params: MujocoParams

    def __init__(self, name: str, params: MujocoParams) -> None:
        """Take the participant's name and its parameters."""
        super().__init__(name, params)
        self._arms: list[RunningArm] = []
        self._corrected: list[RunningArm] = []
        self._motions: list[MotionSide] = []
        self._effective_mass: dict[str, float] = {}
        self._outputs: dict[str, Value] = {}

    @property
    def ports(self) -> tuple[Port, ...]:
        """Per arm, with CRTK's names: `servo_jp` in; `measured_js`, `setpoint_js` and `measured_cp` out."""
        return tuple(port for name, arm in self.params.arms.items() for port in self._arm_ports(name, arm))

    def _arm_ports(self, arm: str, params: PsmParams) -> tuple[Port, ...]:
        names, start, slow = psm.JOINT_NAMES, params.start, self.params.publish_period
        return (
            Port(name=f"{arm}/servo_jp", causality="input", type=_JOINT_STATE, names=names, start=start, description="goal of the joint servos"),
            Port(name=f"{arm}/measured_js", causality="output", type=_JOINT_STATE, names=names, fields=("position", "velocity", "effort")),
            Port(name=f"{arm}/setpoint_js", causality="output", type=_JOINT_STATE, names=names, period_ns=slow),
            Port(name=f"{arm}/measured_cp", causality="output", type="geometry_msgs/msg/PoseStamped", frame=f"{arm}_base", period_ns=slow),
        )

    @property
    def bonds(self) -> tuple[BondSide, ...]:
        """Per arm `<arm>/probe`: the probe's sphere, in the world."""
        mass = self._effective_mass
        return tuple(BondSide(name=f"{arm}/probe", side="motion", frame="world", effective_mass=mass.get(arm)) for arm in self.params.arms)

    def configure(self, setup: Setup) -> Outputs:
        """Build and compile the model, and put the arms where they start."""
        timestep, period = self.params.timestep, setup.period_ns
        if period % timestep:
            problem = (
                f"timestep {timestep / 1e6:g} ms does not divide the participant's period {period / 1e6:g} ms; set it to {period / 1e6:g} ms or a part of it"
            )
            raise ScenarioError(problem, path=("participants", self.name, "timestep"))
        if find_spec("mujoco") is None:
            raise MissingExtraError(f"participant '{self.name}' (kind mujoco)", "mujoco", "mujoco")
        import mujoco

        from engines.mujoco.arm import RunningArm
        from engines.mujoco.model import build

        mujoco.set_mju_user_warning(logging.getLogger(__name__).warning)  # else MuJoCo writes MUJOCO_LOG.TXT where the user stands
        self._mujoco, self._model = mujoco, build(self.params)
        self._data = mujoco.MjData(self._model)
        self._arms = [RunningArm(name, arm, self._model, self._data, setup.period_ns * 1e-9) for name, arm in self.params.arms.items()]
        mujoco.mj_forward(self._model, self._data)
        for arm, bond in zip(self._arms, self.bonds, strict=True):
            self._effective_mass[arm.name] = arm.effective_mass()
            if plan := setup.bonds.get(bond.name):
                motion = MotionSide(bond, plan)
                arm.couple(motion)
                self._motions.append(motion)
                if plan.correction is not None:
                    self._corrected.append(arm)
            arm.refresh()
            self._outputs.update(arm.outputs)
        trouble = mujoco.mjtWarning
        self._trouble = self._data.warning.number.data[trouble.mjWARN_BADQPOS : trouble.mjWARN_BADCTRL + 1]
        self._size = mujoco.mj_stateSize(self._model, mujoco.mjtState.mjSTATE_INTEGRATION)
        self._state = np.empty(self._size + sum(motion.state.size for motion in self._motions))
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Advance all arms by `h` nanoseconds. Raises SessionError if the simulation has become unstable."""
        model, data, step1, step2 = self._model, self._data, self._mujoco.mj_step1, self._mujoco.mj_step2
        for arm in self._arms:
            arm.begin(inputs)
        for tau in range(0, h, self.params.timestep):
            if tau:
                for arm in self._corrected:
                    arm.correct(tau * 1e-9)
            step2(model, data)
            step1(model, data)
        for arm in self._arms:
            arm.end()
        if any(self._trouble):
            raise SessionError(self._diagnosis(t, inputs))
        return self._outputs

    def _diagnosis(self, t: int, inputs: Inputs) -> str:
        bad = self._mujoco.mjtWarning(self._mujoco.mjtWarning.mjWARN_BADQPOS + list(map(bool, self._trouble)).index(True))
        where = f"MuJoCo reports {bad.name} in the step from {t * 1e-9:g} s"
        for port in [port.name for port in self.ports if port.causality == "input"] + [motion.force_port for motion in self._motions]:
            if not np.isfinite(inputs[port]).all():
                return f"{where}: input '{port}' is {inputs[port]}; every number must be finite"
        return (
            f"{where}, arms {', '.join(self.params.arms)}: the simulation is unstable. Likeliest cause: a bond whose wrench is too stiff for its step"
            f" (shorten the step, or use impulse-linearised), else the sub-step (timestep, now {self.params.timestep} ns)"
        )

    def _read_state(self) -> None:
        self._mujoco.mj_getState(self._model, self._data, self._state[: self._size], self._mujoco.mjtState.mjSTATE_INTEGRATION)
        at = self._size
        for motion in self._motions:
            state = motion.state
            self._state[at : at + state.size] = state
            at += state.size

    def state_hash(self) -> int:
        """Return the hash of MuJoCo's integration state and of the bonds' books."""
        self._read_state()
        return state_hash(self._state)

    def save(self) -> bytes:
        """Return MuJoCo's integration state (`mjSTATE_INTEGRATION`) and the bonds' books."""
        self._read_state()
        return self._state.tobytes()

    def restore(self, state: bytes) -> None:
        """Return to a saved state, bit for bit. Raises StateError if it is none of this model's."""
        if len(state) != self._state.nbytes:
            raise StateError(f"participant '{self.name}': a saved state of {len(state)} bytes, this model's has {self._state.nbytes}; was it saved elsewhere?")
        values = np.frombuffer(state)
        self._mujoco.mj_setState(self._model, self._data, values[: self._size], self._mujoco.mjtState.mjSTATE_INTEGRATION)
        self._mujoco.mj_step1(self._model, self._data)
        at = self._size
        for motion in self._motions:
            size = motion.state.size
            motion.state = values[at : at + size]
            at += size
        for arm in self._arms:
            arm.refresh()

    def close(self) -> None:
        """Let go of model and data."""
        self._arms.clear()
        self._corrected.clear()
        self._outputs.clear()
