"""The force of rigid contacts on an instrument: with table, objects, cart and further arms."""

from __future__ import annotations

from collections.abc import Iterable

import mujoco
import numpy as np
from numpy.typing import NDArray

from engines.mujoco.interaction.collisions import Collisions
from engines.mujoco.model import instrument_body
from robots.vector3 import cross
from schemas.vectors import Vector

__all__ = ["RigidContact"]


class RigidContact:
    """The mean contact force on the instruments of some arms over the sub-steps of a step.

    The load of a held object counts through contacts or the weld. Contacts within an instrument do not count.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        arms: Iterable[str],
        *,
        fixtures: Iterable[str] = (),
        every: float = 0.0,
    ) -> None:
        """Watch the instruments of `arms`, and collisions if there are `fixtures`.

        `add` is called for `every` seconds.
        """
        self._model, self._data, arms = model, data, list(arms)
        self._owner = _owners(model, arms)
        self._welds = [
            (weld, arms.index(arm)) for weld in range(model.neq) if (arm := _welded_to(model, weld)) in arms
        ]
        tips = np.array([int(model.sensor(f"{arm}/tip/position").adr[0]) for arm in arms], int)
        self._tips = tips[:, None] + np.arange(3)
        self._to_base: list[Vector] = [
            np.kron(np.eye(2), data.site_xmat[model.site(f"{arm}/base").id].reshape(3, 3).T) for arm in arms
        ]
        self._index = {arm: i for i, arm in enumerate(arms)}
        self._arms = np.arange(len(arms))
        self._sums, self._means = np.zeros((len(arms), 6)), np.zeros((len(arms), 6))
        self._substeps, self._is_touched, self._was_touched = 0, False, False
        self._geoms, self._found, self._kinds = b"", np.zeros(0, np.intp), np.zeros(0, np.intp)
        """Last seen pairs of geoms in contact, indices of the counting pairs, and kinds of collisions."""
        self.collisions = Collisions(model, self._owner, fixtures, every) if fixtures else None
        self._sides = np.zeros((0, len(arms)))
        """Side by pair and arm: 1 if the second geom is of the arm, -1 the first, 0 none."""
        self.outputs = {f"{arm}/rigid_wrench": mean for arm, mean in zip(arms, self._means, strict=True)}
        if self.collisions is not None:
            self.outputs |= self.collisions.outputs

    def add(self) -> None:
        """Add the forces of a sub-step, between `mj_step2` and `mj_step1`.

        There the forces are solved, and the contacts are still the contacts of these forces.
        """
        self._substeps += 1
        if self._data.ncon:
            self._add_contacts()
        for weld, owner in self._welds:
            if self._data.eq_active[weld]:
                self._add_weld(weld, owner)

    def end(self) -> None:
        """Set the outputs to the mean over the sub-steps since the last call."""
        if not self._is_touched:
            if self._was_touched:
                self._means[:] = 0.0
            self._substeps, self._was_touched = 0, False
            return
        for to_base, total, mean in zip(self._to_base, self._sums, self._means, strict=True):
            to_base.dot(total, mean)
        self._means /= self._substeps
        self._sums[:] = 0.0
        self._substeps, self._is_touched, self._was_touched = 0, False, True

    def refresh(self) -> None:
        """Update the changed outputs."""
        if self.collisions is not None:
            self.collisions.refresh()

    def give(self, arm: str, wrench: Vector, to: Vector) -> None:
        """Move `wrench` (N, N m about the world's origin), a part of a mean, to another output.

        Without rigid contact in a step nothing moves.
        """
        i = self._index[arm]
        if not self._means[i].any():
            return
        at_tip = wrench.copy()
        at_tip[3:] -= cross(self._data.sensordata[self._tips[i]], wrench[:3])
        part = self._to_base[i] @ at_tip
        self._means[i] -= part
        to += part

    def _add_contacts(self) -> None:
        geoms = self._data.contact.geom  # (contacts, 2)
        pairs = geoms.tobytes()
        if pairs != self._geoms:  # most contacts last: objects lie on the table for many sub-steps
            owners = self._owner[geoms]
            self._geoms = pairs
            self._found = (owners[:, 0] != owners[:, 1]).nonzero()[0]
            if self.collisions is not None:
                self._kinds = self.collisions.kinds(geoms[self._found])
            owned = owners[self._found][:, :, None] == self._arms
            self._sides = owned[:, 1] * 1.0 - owned[:, 0]
        if self._found.size:
            self._add_forces(self._found)

    def _add_forces(self, found: NDArray[np.intp]) -> None:
        model, data, contact = self._model, self._data, self._data.contact
        self._is_touched = True
        loads = np.empty((len(found), 6))  # on the second geom: force and torque
        for load, i in zip(loads, found.tolist(), strict=True):
            mujoco.mj_contactForce(model, data, i, load)
        if self.collisions is not None:
            self.collisions.add(self._kinds, loads[:, :3])
        loads.reshape(-1, 2, 3)[:] = loads.reshape(-1, 2, 3) @ contact.frame[found].reshape(-1, 3, 3)
        loads[:, 3:] += cross(contact.pos[found], loads[:, :3])
        total = self._sides.T @ loads
        total[:, 3:] -= cross(data.sensordata[self._tips], total[:, :3])
        self._sums += total

    def _add_weld(self, weld: int, owner: int) -> None:
        """Add the reaction of the object in a weld.

        The free joint has the force at the object's origin in the world, and the torque in the object's
        frame.
        """
        self._is_touched = True
        model, data = self._model, self._data
        of_weld = (data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY) & (data.efc_id == weld)
        generalised = np.zeros(model.nv)
        mujoco.mj_mulJacTVec(model, data, generalised, np.where(of_weld, data.efc_force, 0.0))
        thing = int(model.eq_obj2id[weld])
        first = int(model.body_dofadr[thing])
        force, torque = (
            generalised[first : first + 3],
            data.xmat[thing].reshape(3, 3) @ generalised[first + 3 : first + 6],
        )
        arm = data.xpos[thing] - data.sensordata[self._tips[owner]]
        self._sums[owner, :3] -= force
        self._sums[owner, 3:] -= torque + cross(arm, force)


def _owners(model: mujoco.MjModel, arms: list[str]) -> NDArray[np.intp]:
    """Return for every geom of `model` the index of the instrument's arm, else -1."""
    owners = np.full(model.nbody, -1)
    root = instrument_body("")
    for body in range(model.nbody):
        name = model.body(body).name
        if (arm := name.partition("/")[0]) in arms and name.endswith(root):  # a spare's too
            owners[body] = arms.index(arm)
    for body, parent in enumerate(model.body_parentid.tolist()):  # which comes before it
        owners[body] = max(owners[body], owners[parent])
    return owners[model.geom_bodyid]


def _welded_to(model: mujoco.MjModel, equality: int) -> str | None:
    """Return the arm of a weld to an object; None for other equalities."""
    is_weld = model.eq_type[equality] == mujoco.mjtEq.mjEQ_WELD
    return model.body(int(model.eq_obj1id[equality])).name.partition("/")[0] if is_weld else None
