"""Exchange of instruments: one instrument of an arm is in the seat, all others are out of use, far away.

The model has all instruments of an arm. An instrument out of use has neither mass nor friction, touches
nothing and is driven by nothing, so that the arm moves as if it had the instrument in the seat alone. Where
the seats are is part of `qpos`, so pictures, pages and recordings know the instrument without a word more.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from engines.mujoco.model.names import PARKED_M, SEAT
from hub.participant import Inputs
from robots.dvrk.mounted.mounted_arms import AnyArm
from robots.dvrk.setup_joints import DrivenArm
from schemas.errors import SessionError
from schemas.vectors import Vector

__all__ = ["Exchange"]

_OF_WRIST = ("roll", "wrist_pitch", "wrist_yaw")
"""Joints of every instrument that may be exchanged."""
_Numbers = Sequence[int] | NDArray[np.intp]


@dataclass(frozen=True)
class _Instrument:
    """Parts of an instrument in the model, by number."""

    seat: int
    """Place of the seat in `qpos`."""
    joints: Mapping[str, int]
    """Joint by link."""
    bodies: _Numbers
    geoms: _Numbers
    dofs: _Numbers
    """Degrees of freedom, the seat's first."""
    discs: _Numbers
    ties: _Numbers
    """Ties of fingers."""
    welds: _Numbers
    """Welds to objects."""
    tip: int
    """Site of the tip."""


class Exchange:
    """Puts the instrument asked for into the seat of each arm with spares."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, arms: Mapping[DrivenArm, AnyArm]) -> None:
        """Put the mounted instruments into the seats."""
        self._model, self._data = model, data
        self._arms: dict[str, AnyArm] = {
            name: params for name, params in arms.items() if len(params.variants) > 1
        }
        self.owners = {str(name): list(params.by_owner(name)) for name, params in self._arms.items()}
        """Prefixes of the names of an arm's instruments, by arm, where there are spares."""
        self._instruments = {
            name: [_find(model, owner, owners) for owner in owners] for name, owners in self.owners.items()
        }
        self._sensors = {name: _sensors_at_instrument(model, name) for name in self._arms}
        self._engaged = np.zeros(len(self._arms))
        self._whole = [
            model.body_mass.copy(),
            model.body_inertia.copy(),
            model.geom_contype.copy(),
            model.geom_conaffinity.copy(),
            model.dof_frictionloss.copy(),
            model.tendon_frictionloss.copy(),
        ]
        every = [one for own in self._instruments.values() for one in own]
        self._seats, self._slides = (
            np.array([one.seat for one in every], int),
            np.array([one.dofs[0] for one in every], int),
        )
        self._places = np.zeros(len(every))
        """Positions of all seats, m."""
        if self._arms:
            self._fit()

    @property
    def engaged(self) -> Mapping[str, int]:
        """Number of the instrument in the seat by arm, where there are spares: 0 is the mounted one."""
        return dict(zip(self._arms, self._engaged.astype(int).tolist(), strict=True))

    def asked(self, inputs: Inputs) -> Mapping[str, int]:
        """Return the instruments to be given to arms. Raises SessionError for an unknown number."""
        found: dict[str, int] = {}
        for arm, now in self.engaged.items():
            number, count = inputs.number(f"{arm}/instrument", now), len(self._arms[arm].variants)
            if number not in range(count):
                raise SessionError(f"input '{arm}/instrument' is {number:g}, allowed are 0 to {count - 1}")
            if number != now:
                found[arm] = int(number)
        return found

    def engage(self, arm: str, number: int) -> None:
        """Let `arm` have an instrument from now on; `put` moves it into the seat."""
        self._engaged[list(self._arms).index(arm)] = number
        self._fit()

    def hold(self) -> None:
        """Keep the seats where they are, whatever the forces on them."""
        self._data.qpos[self._seats] = self._places
        self._data.qvel[self._slides] = 0.0

    def put(self, arm: str, joints: Vector, jaw: Vector) -> None:
        """Move the engaged instrument of `arm` into the seat, and all others out.

        Args:
            arm: name of the arm.
            joints: setpoint of the arm's joints, shape (n,): the instrument starts there, at rest.
            jaw: setpoint of the jaw; empty without one.
        """
        params, model, data = self._arms[arm], self._model, self._data
        for number, (one, variant) in enumerate(zip(self._instruments[arm], params.variants, strict=True)):
            is_engaged = number == self.engaged[arm]
            data.qvel[one.dofs] = 0.0
            data.eq_active[one.ties] = is_engaged
            data.eq_active[one.welds] = 0  # what the last one held falls
            if is_engaged:
                goals = dict(zip(variant.chain.names, joints.tolist(), strict=True))
                goals |= variant.end_effector.positions(jaw[: len(variant.end_effector.joints)])
                for link, joint in one.joints.items():
                    goal = float(np.clip(goals[link], *model.jnt_range[joint]))
                    data.qpos[model.jnt_qposadr[joint]] = goal
        self.hold()

    def _fit(self) -> None:
        """Give the engaged instruments, and no others, mass, friction, contacts and the arm's sensors."""
        model = self._model
        present = (
            model.body_mass,
            model.body_inertia,
            model.geom_contype,
            model.geom_conaffinity,
            model.dof_frictionloss,
            model.tendon_frictionloss,
        )
        for values, whole in zip(present, self._whole, strict=True):
            values[:] = whole
        self._places[:] = -PARKED_M
        for arm, number in self.engaged.items():
            for i, one in enumerate(self._instruments[arm]):
                parts = (one.bodies, one.bodies, one.geoms, one.geoms, one.dofs, one.discs)
                if i != number:
                    for values, own in zip(present, parts, strict=True):
                        values[own] = 0
            engaged = self._instruments[arm][number]
            self._places[self._seats == engaged.seat] = 0.0
            at_joints, at_tip = self._sensors[arm]
            for sensor, link in at_joints.items():
                model.sensor_objid[sensor] = engaged.joints[link]
            model.sensor_objid[at_tip] = engaged.tip
        mujoco.mj_setConst(model, mujoco.MjData(model))
        # the solver's measure of small forces, without the seats' inertia
        model.stat.meaninertia = np.delete(model.dof_M0, self._slides).mean()

    @property
    def state(self) -> Vector:
        """State beyond MuJoCo's: number of the engaged instrument by arm; the same array at every call."""
        return self._engaged

    @state.setter
    def state(self, state: Vector) -> None:
        if not np.array_equal(state, self._engaged):
            self._engaged[:] = state
            self._fit()


def _find(model: mujoco.MjModel, owner: str, owners: Sequence[str]) -> _Instrument:
    """Return the parts of the instrument with names that begin with `owner`, of an arm with `owners`."""
    seat = model.joint(f"{owner}/{SEAT}")
    bodies = [model.body(f"{owner}/{SEAT}").id]
    for body, parent in enumerate(model.body_parentid.tolist()):  # which comes before it
        if parent in bodies:
            bodies.append(body)
    dofs = np.flatnonzero(np.isin(model.dof_bodyid, bodies))
    spares = [f"{other}/" for other in owners if other != owner and len(other) > len(owner)]

    def is_own(name: str) -> bool:
        return name.startswith(f"{owner}/") and not name.startswith(tuple(spares))

    joints = {
        model.joint(i).name.removeprefix(f"{owner}/"): i
        for i in range(model.njnt)
        if model.jnt_bodyid[i] in bodies and i != seat.id
    }
    moved = set(joints.values())
    return _Instrument(
        seat=int(seat.qposadr[0]),
        joints=joints,
        bodies=bodies,
        geoms=np.flatnonzero(np.isin(model.geom_bodyid, bodies)),
        dofs=[int(seat.dofadr[0]), *(one for one in dofs.tolist() if one != int(seat.dofadr[0]))],
        discs=[i for i in range(model.ntendon) if is_own(model.tendon(i).name)],
        ties=[
            i
            for i in range(model.neq)
            if model.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT and int(model.eq_obj1id[i]) in moved
        ],
        welds=[
            i
            for i in range(model.neq)
            if model.eq_type[i] == mujoco.mjtEq.mjEQ_WELD and int(model.eq_obj1id[i]) in bodies
        ],
        tip=model.site(f"{owner}/tip").id,
    )


def _sensors_at_instrument(model: mujoco.MjModel, arm: str) -> tuple[Mapping[int, str], list[int]]:
    """Return the arm's sensors at joints of the mounted instrument, with the joint, and those at its tip."""
    tip = model.site(f"{arm}/tip").id
    at_joints: dict[int, str] = {}
    at_tip: list[int] = []
    for i in range(model.nsensor):
        prefix, _, link = model.sensor(i).name.rpartition("/")
        if prefix in (f"{arm}/position", f"{arm}/velocity", f"{arm}/effort") and link in _OF_WRIST:
            at_joints[i] = link
        elif model.sensor_objtype[i] == mujoco.mjtObj.mjOBJ_SITE and model.sensor_objid[i] == tip:
            at_tip.append(i)
    return at_joints, at_tip
