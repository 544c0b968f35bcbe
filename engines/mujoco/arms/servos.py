"""The drives of all arms of a scene: commands in, inputs of MuJoCo's servos out.

All joints of all arms stand in one vector, in the order of the arms: joints of the arm, then of the end
effector. The setpoints follow the commands at most as fast as joints may move, so no jump of a command closes
a jaw through an object between the fingers. A matrix product gives the inputs of the servos: position, its
slope as velocity, and a feed-forward effort.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import mujoco
import numpy as np

from engines.mujoco.arms.friction import Friction
from hub.participant import Inputs
from robots.dvrk.mounted.mounted_arms import AnyArm
from robots.dvrk.mounted.mounted_mtm import MountedMtm
from robots.dvrk.psm import ARM_JOINTS
from robots.dvrk.setup_joints import DrivenArm
from robots.serial_chain import Joint
from schemas.errors import SessionError
from schemas.vectors import Vector, join_parts

__all__ = ["ServoLaw", "Servos"]

_OFF, _POSITION, _EFFORT = 0.0, 1.0, 2.0
"""Control modes: no torque, position servo, effort. The latter two with gravity compensation."""
_LOCKED = 5.0
"""Control mode of a master with a locked orientation: effort in the first joints, position in the wrist."""
_BEFORE_WRIST = 3
"""Joints of a master in effort mode while its orientation is locked, as on the real controller
(jhu-dvrk/sawIntuitiveResearchKit, mtsIntuitiveResearchKitMTM.cpp, SetControlEffortActiveJoints).
"""
_BARE = 2.0
"""Added to position servo and effort: without gravity compensation, as on the real controller, see
docs/decisions/0010.
"""

_MODES = (_OFF, _POSITION, _EFFORT, _POSITION + _BARE, _EFFORT + _BARE)
_LOCKS = (_LOCKED, _LOCKED + 1.0)
_BARE_MODES: Mapping[float, float] = {
    _POSITION + _BARE: _POSITION,
    _EFFORT + _BARE: _EFFORT,
    _LOCKED + 1.0: _LOCKED,
}
"""Mode of the drives in each mode without gravity compensation."""
_OF_ARM = frozenset(joint.name for joint in ARM_JOINTS)
"""Joints that all instruments of an arm have in common."""
_Row = tuple[float, float, float, float]
"""Start, lower and upper limit, velocity of a joint."""
_Share = tuple[int, int, float]
"""Actuator, joint, and the actuator's share of the joint's position."""


class _Axes(NamedTuple):
    """Joints commanded together, with start and motors."""

    joints: Sequence[Joint]
    start: Sequence[float]
    motors: Sequence[Sequence[tuple[str, str, float]]]
    """Motors of each instrument: actuator, name of the joint, and the motor's share of its position."""


class ServoLaw(NamedTuple):
    """Numbers of the position servos of all arms, with n drives.

    In a step a setpoint goes to the command within `lower` and `upper`, at most by `way`. The effort is
    `springs * (setpoint - rest)`, and `ctrl` is `layout @ [setpoint, setpoint a step ago, effort]`.
    """

    lower: Vector
    upper: Vector
    way: Vector
    springs: Vector
    rest: Vector
    layout: Vector
    """Shape (nu, 3 n)."""


@dataclass
class _Group:
    """Joints with a common pair of ports: joints of an arm, or of an end effector."""

    arm: str
    ports: str
    """Names of the ports up to `servo_jp` and `servo_jf`."""
    bodies: list[int]
    """Bodies with weight on the controller."""
    part: slice = field(default_factory=lambda: slice(0))
    """Place in the vectors of all joints."""
    actuators: list[int] = field(default_factory=list[int])
    weighed: list[int] = field(default_factory=list[int])
    """Bodies with weight on the real controller too: the endoscope, masters. Springs balance all else."""
    mode: float = _POSITION
    spares: list[list[_Share]] = field(default_factory=list[list[_Share]])
    """Motors of each instrument, the mounted one first, where the arm has spares."""

    def engage(self, variant: int) -> None:
        """Let the motors of an instrument be the group's, in place of all other instruments'."""
        own = {actuator for shares in self.spares for actuator, *_ in shares}
        self.actuators = [one for one in self.actuators if one not in own]
        self.actuators += [actuator for actuator, *_ in self.spares[variant]]


class Servos:
    """Turns commands and modes into setpoints and efforts."""

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        arms: Mapping[DrivenArm, AnyArm],
        period: float,
    ) -> None:
        """Drive `arms`, stepped every `period` seconds, from the start."""
        self._model, self._data = model, data
        self._groups: list[_Group] = []
        rows: list[_Row] = []
        shares: list[_Share] = []
        for arm, params in arms.items():
            variants = params.by_owner(arm)
            effector = params.commanded_end_effector
            grasping = {
                f"{owner}/{link.name}" for owner, one in variants.items() for link in one.end_effector_links
            }
            own = [i for i in range(model.nbody) if model.body(i).name.startswith(f"{arm}/")]
            fixed = [i for i in own if model.body(i).name not in grasping]
            motors = [
                [
                    (f"{owner}/{joint.name}", joint.name, 1.0)
                    for joint in one.chain.joints
                    if owner == arm or joint.name not in _OF_ARM
                ]
                for owner, one in variants.items()
            ]
            joints = _widest([one.chain.joints for one in params.variants])
            axes = _Axes(joints, params.start, motors)
            self._add_group(_Group(arm, f"{arm}/", fixed), axes, rows, shares)
            if effector.joints:
                motors = [
                    [(f"{owner}/{motor.name}", motor.joint, motor.share) for motor in one.end_effector.motors]
                    for owner, one in variants.items()
                ]
                joints = _widest([one.end_effector.joints for one in params.variants])
                axes = _Axes(joints, params.end_effector_start or (0.0,), motors)
                moving = [i for i in own if i not in fixed]
                self._add_group(_Group(arm, f"{arm}/{effector.name}/", moving), axes, rows, shares)
        start, self._lower, self._upper, speed = np.array(rows).T.copy()
        n = start.size
        self._inputs = np.concatenate([start, start, np.zeros(n)])
        self.setpoint, self._previous, self._effort = np.split(self._inputs, 3)
        self._reach, self._ways = np.empty((2, n)), np.outer((-1.0, 1.0), speed * period)
        self._layout, self._measure = self._servo_matrices(shares, n, period)
        self._springs, self._rest = self._elasticity(shares, n)
        self._gains = model.actuator_gainprm.copy(), model.actuator_biasprm.copy()
        self._gravity_compensation = model.body_gravcomp.copy()
        self._friction = {arm: Friction(model, arm) for arm in arms}
        self._mode_ports = {arm: f"{arm}/control_mode" for arm in arms}
        self._ports = *self._mode_ports.values(), *(f"{group.ports}servo_jp" for group in self._groups)
        self._masters = frozenset(arm for arm, params in arms.items() if isinstance(params, MountedMtm))
        self._state = np.concatenate([start, np.full(2 * len(arms), _POSITION)])
        self._modes = self._state[n:]  # per arm those of its joints and its jaw
        self._taken = np.concatenate([self._modes, start])
        self._asked, self._command = np.split(self._taken, [2 * len(arms)])
        self.off: frozenset[str] = frozenset()
        """Arms without torque in the joints."""
        self._holding = True
        self._at_rest = b""
        """The commands and modes reached; empty while setpoints move."""
        np.multiply(self._springs, start - self._rest, out=self._effort)
        self._layout.dot(self._inputs, data.ctrl)

    def _add_group(self, group: _Group, axes: _Axes, rows: list[_Row], shares: list[_Share]) -> None:
        """Add joints commanded together, and their motors."""
        model, first = self._model, len(rows)
        places = {joint.name: first + i for i, joint in enumerate(axes.joints)}
        by_instrument = [
            [(model.actuator(motor).id, places[joint], share) for motor, joint, share in motors]
            for motors in axes.motors
        ]
        group.actuators = [actuator for actuator, *_ in by_instrument[0]]
        shares += [one for own in by_instrument for one in own]
        if len(by_instrument) > 1:
            arm = {places[name] for name in _OF_ARM if name in places}
            group.spares = [[one for one in own if one[1] not in arm] for own in by_instrument]
        rows += [
            (q, joint.lower, joint.upper, joint.velocity)
            for q, joint in zip(axes.start, axes.joints, strict=True)
        ]
        group.part = slice(first, len(rows))
        group.weighed += [i for i in group.bodies if _is_weighed(model.body(i).name)]
        self._groups.append(group)

    def _servo_matrices(
        self, shares: list[tuple[int, int, float]], n: int, period: float
    ) -> tuple[Vector, Vector]:
        """Return two matrices, from the servos' inputs to `ctrl` and from `qpos` to the drives' positions.

        The servos' inputs are the setpoint, the setpoint a step ago, and the effort.
        """
        model = self._model
        layout, measure = np.zeros((model.nu, 3 * n)), np.zeros((n, model.nq))
        for actuator, drive, share in shares:
            at = int(model.actuator_ctrladr[actuator])
            layout[at, drive] = share
            layout[at + 1, [drive, n + drive]] = share / period, -share / period
            # both fingers with the jaw's torque: their work is then that of the jaw
            layout[at + 2, 2 * n + drive] = 1.0
            for joint, coefficient in self._joints_of_actuator(actuator):
                measure[drive, model.jnt_qposadr[joint]] = coefficient
        return layout, measure

    def _joints_of_actuator(self, actuator: int) -> list[tuple[int, float]]:
        """Return the joints of an actuator, each with the factor of its share in the actuator's position."""
        model, target = self._model, int(self._model.actuator_trnid[actuator, 0])
        if model.actuator_trntype[actuator] != mujoco.mjtTrn.mjTRN_TENDON:
            return [(target, 1.0)]
        wraps = range(int(model.tendon_adr[target]), int(model.tendon_adr[target] + model.tendon_num[target]))
        return [(int(model.wrap_objid[i]), float(model.wrap_prm[i])) for i in wraps]

    def _elasticity(self, shares: list[tuple[int, int, float]], n: int) -> tuple[Vector, Vector]:
        """Return stiffness of the joints' own springs and where these are at rest, both shape (n,)."""
        model = self._model
        stiffness, rest = np.zeros(n), np.zeros(n)
        for actuator, drive, _share in shares:
            joint = self._joints_of_actuator(actuator)[0][0]
            stiffness[drive], rest[drive] = (
                np.ravel(model.jnt_stiffness[joint])[0],
                model.qpos_spring[model.jnt_qposadr[joint]],
            )
        return stiffness, rest

    @property
    def law(self) -> ServoLaw:
        """Numbers of the position servos, for a servo outside of a session."""
        return ServoLaw(self._lower, self._upper, self._ways[1], self._springs, self._rest, self._layout)

    def arm_setpoint(self, arm: str) -> Vector:
        """Return the joints of `arm` as a view of `setpoint`."""
        return self.setpoint[next(group.part for group in self._groups if group.arm == arm)]

    def jaw_setpoint(self, arm: str) -> Vector:
        """Return the jaw of `arm` as a view of `setpoint`; empty without one."""
        _, *jaw = (group.part for group in self._groups if group.arm == arm)
        return self.setpoint[jaw[0] if jaw else slice(0)]

    def engage(self, engaged: Mapping[str, int]) -> None:
        """Drive the engaged instruments, by arm, and let the motors of all others rest."""
        gain, bias = self._gains
        for group in self._groups:
            if not group.spares:
                continue
            group.engage(engaged[group.arm])
            holds = group.mode == _POSITION
            for number, shares in enumerate(group.spares):
                driven = holds and number == engaged[group.arm]
                for actuator, *_ in shares:
                    self._model.actuator_gainprm[actuator] = gain[actuator] * driven
                    self._model.actuator_biasprm[actuator] = bias[actuator] * driven
                for _, drive, _ in shares:
                    self._measure[drive] = 0.0
            for actuator, drive, _ in group.spares[engaged[group.arm]]:
                for joint, coefficient in self._joints_of_actuator(actuator):
                    self._measure[drive, self._model.jnt_qposadr[joint]] = coefficient
        self._at_rest = b""

    def begin(self, inputs: Inputs) -> None:
        """Apply commands and modes at the beginning of a step; unchanged and reached commands cost nothing.

        Raises SessionError for an unknown mode.
        """
        taken = [inputs[port] for port in self._ports]
        asked = join_parts(taken)
        if asked == self._at_rest:
            return
        np.concatenate(taken, out=self._taken)
        if self._asked.tobytes() != self._modes.tobytes():
            self._set_modes(self._asked)
        command, setpoint, reach = self._command, self.setpoint, self._reach
        np.maximum(command, self._lower, out=command)
        np.minimum(command, self._upper, out=command)
        np.add(setpoint, self._ways, out=reach)
        self._previous[:] = setpoint
        np.maximum(command, reach[0], out=command)
        np.minimum(command, reach[1], out=setpoint)
        # what holds against the springs there
        np.multiply(self._springs, np.subtract(setpoint, self._rest, out=self._effort), out=self._effort)
        if not self._holding:
            self._let_go(inputs)
        self._layout.dot(self._inputs, self._data.ctrl)
        is_at_rest = self._holding and setpoint.tobytes() == self._previous.tobytes()
        self._at_rest = asked if is_at_rest else b""

    def series(self, inputs: Inputs, count: int, series: Mapping[str, Vector]) -> Vector:
        """Return `ctrl` of the next `count` steps, shape (count, nu), with the bits of `begin` step by step.

        `series`: commands of ports in each step, shape (count, size). Raises SessionError unless every arm
        is servoed to positions: else commands depend on the simulation.
        """
        rows = [
            series[port] if port in series else np.repeat(inputs[port][None], count, axis=0)
            for port in self._ports
        ]
        asked, commands = np.split(np.hstack(rows), [self._asked.size], axis=1)
        if (asked != _POSITION).any() or (self._modes != _POSITION).any():
            raise SessionError("arms without plain position servo go step by step only: use `advance`")
        setpoints = self._follow(np.minimum(np.maximum(commands, self._lower), self._upper))
        inputs_of = np.empty((count, self._inputs.size))
        made, n = np.empty((count, self._data.ctrl.size)), self.setpoint.size
        inputs_of[:, :n] = setpoints
        inputs_of[0, n : 2 * n], inputs_of[1:, n : 2 * n] = self.setpoint, setpoints[:-1]
        np.multiply(self._springs, setpoints - self._rest, out=inputs_of[:, 2 * n :])
        for row, ctrl in zip(inputs_of, made, strict=True):
            self._layout.dot(row, ctrl)
        self._inputs[:] = inputs_of[-1]
        self._at_rest = b""
        return made

    def _follow(self, commands: Vector) -> Vector:
        """Return the setpoints that follow commands, shape (count, n), no faster than joints may move."""
        before = np.concatenate([self.setpoint[None], commands[:-1]])
        if (commands >= before + self._ways[0]).all() and (commands <= before + self._ways[1]).all():
            return commands
        setpoints, setpoint = np.empty_like(commands), self.setpoint
        for row, command in zip(setpoints, commands, strict=True):
            reach = setpoint + self._ways
            np.minimum(np.maximum(command, reach[0]), reach[1], out=row)
            setpoint = row
        return setpoints

    def _let_go(self, inputs: Inputs) -> None:
        """Apply the commanded effort where no position is held, and let the setpoint follow the joint."""
        measured = np.clip(self._measure @ self._data.qpos, self._lower, self._upper)
        for group in self._groups:
            part = group.part
            if group.mode == _LOCKED:
                part = slice(part.start, part.start + _BEFORE_WRIST)
                self._effort[part] = inputs[group.ports + "servo_jf"][:_BEFORE_WRIST]
                self.setpoint[part] = self._previous[part] = measured[part]
            elif group.mode != _POSITION:
                self._effort[part] = inputs[group.ports + "servo_jf"] if group.mode == _EFFORT else 0.0
                self.setpoint[part] = self._previous[part] = measured[part]

    def _set_modes(self, modes: Vector) -> None:
        """Switch the drives; `modes`, shape (2 arms,): joints and end effector of every arm."""
        gain, bias = self._gains
        for (arm, port), asked in zip(self._mode_ports.items(), modes.reshape(-1, 2), strict=True):
            if not (np.isin(asked, _MODES).all() or (arm in self._masters and asked[0] in _LOCKS)):
                raise SessionError(
                    f"input '{port}' is {asked}; each of [arm, jaw] is 0 (off), 1 (position servo) or 2"
                    " (effort), 3 and 4 the last two without gravity compensation; of a master's joints also"
                    " 5 (orientation locked) and 6, the same without gravity compensation"
                )
            for group, number in zip(
                [group for group in self._groups if group.arm == arm], asked.tolist(), strict=False
            ):
                mode = _BARE_MODES.get(number, number)
                holds = np.full((len(group.actuators), 1), mode in (_POSITION, _LOCKED))
                if mode == _LOCKED:
                    holds[:_BEFORE_WRIST] = False
                self._model.actuator_gainprm[group.actuators] = gain[group.actuators] * holds
                self._model.actuator_biasprm[group.actuators] = bias[group.actuators] * holds
                self._model.body_gravcomp[group.bodies] = self._gravity_compensation[group.bodies] * (
                    mode != _OFF
                )
                self._model.body_gravcomp[group.weighed] *= number == mode
                group.mode = mode
            self._friction[arm].set(dry=asked[0] in (_EFFORT, _EFFORT + _BARE, *_LOCKS))
        self._modes[:] = modes
        self.off = frozenset(
            arm for arm, mode in zip(self._mode_ports, modes[::2].tolist(), strict=True) if mode == _OFF
        )
        self._holding = all(group.mode == _POSITION for group in self._groups)

    @property
    def state(self) -> Vector:
        """State beyond MuJoCo's: setpoints and modes; the same array at every call."""
        self._state[: self.setpoint.size] = self.setpoint
        return self._state

    @state.setter
    def state(self, state: Vector) -> None:
        self._at_rest = b""
        self.setpoint[:] = state[: self.setpoint.size]
        self._set_modes(state[self.setpoint.size :])


def _is_weighed(body: str) -> bool:
    """Return whether the real controller carries the weight of a body, and no spring or counterweight."""
    return body == "ECM/roll" or body.startswith(("MTML/", "MTMR/"))


def _widest(chains: Sequence[Sequence[Joint]]) -> Sequence[Joint]:
    """Return the joints of all instruments by name, each with the widest range."""
    found: dict[str, Joint] = {}
    for joint in (one for joints in chains for one in joints):
        known = found.setdefault(joint.name, joint)
        if known is not joint:
            ends = min(known.lower, joint.lower), max(known.upper, joint.upper)
            found[joint.name] = replace(known, lower=ends[0], upper=ends[1])
    return tuple(found.values())
