"""Objects held by jaws.

An object is held by an arm once both fingers have touched it for `_SETTLED`. With `grasp: weld` a weld
between wrist and object is active for as long; with `grasp: friction` only contact acts, and this module only
observes. With `grasp: proximity` a ray takes the place of the contacts, and an object on the ray is welded at
once.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import acos

import mujoco
import numpy as np
from numpy.typing import NDArray

from engines.mujoco.interaction.proximity_rays import ProximityRays
from engines.mujoco.model.poses import ROS_ORDER
from engines.mujoco.model.rigid import RIGID
from engines.mujoco.params import SceneParams
from robots.dvrk.end_effectors.jaw import FINGERS, Jaw
from schemas.vectors import Vector

__all__ = ["Holding", "prepare"]

_SETTLED = 0.1
"""s; time for a jaw at greatest speed to come to rest on the object."""


def prepare(spec: mujoco.MjSpec, scene: SceneParams) -> None:
    """Add to the model of `scene` the welds between jaws and objects, not active yet."""
    if scene.grasp != "friction":
        for thing in scene.objects:
            for arm in _arms_with_jaw(scene):
                ends = {"objtype": mujoco.mjtObj.mjOBJ_BODY, "name1": f"{arm}/wrist_yaw", "name2": thing}
                spec.add_equality(
                    name=f"{thing}/{arm}/weld", type=mujoco.mjtEq.mjEQ_WELD, active=False, **ends, **RIGID
                )


def _arms_with_jaw(scene: SceneParams) -> list[str]:
    return list(_finger_lengths(scene))


def _finger_lengths(scene: SceneParams) -> dict[str, float]:
    """Return the length of the fingers of every instrument with a jaw, m, by owner."""
    return {
        owner: one.end_effector.length
        for name, arm in scene.arms.items()
        for owner, one in arm.by_owner(name).items()
        if isinstance(one.end_effector, Jaw)
    }


class Holding:
    """Watches objects and jaws; makes the outputs of the objects."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, scene: SceneParams, period: float) -> None:
        """Watch the objects of `scene`; `update` is called every `period` seconds."""
        things, arms = list(scene.objects), _arms_with_jaw(scene)
        self._model, self._data = model, data
        self._rays = (
            ProximityRays(model, data, things, _finger_lengths(scene)) if scene.grasp == "proximity" else None
        )
        self._settled = 1 if self._rays is not None else max(1, round(_SETTLED / period))
        self._things, self._arms = {thing: i for i, thing in enumerate(things)}, arms
        self._numbers = [int(arm.partition("/")[0][-1]) for arm in arms]
        self._bodies = [model.body(thing).id for thing in things]
        # an arm with spare instruments counts once for each of them
        # in what slip is measured: what a ray holds does not move with a finger
        part = FINGERS[0] if self._rays is None else "wrist_yaw"
        self._fingers = [model.body(f"{arm}/{part}").id for arm in arms]
        self._wrists = [model.body(f"{arm}/wrist_yaw").id for arm in arms]
        shape = (len(things), len(arms))
        self._ends = _ends(model, things, [f"{arm}/{finger}" for arm in arms for finger in FINGERS])
        self._reach = _reaches(model, self._ends)
        self._contacts = np.zeros((*shape, 2, 4))  # per finger: how many, sum of their positions
        welds = (
            [model.equality(f"{thing}/{arm}/weld").id for thing in things for arm in arms]
            if scene.grasp != "friction"
            else []
        )
        self._welds = np.array(welds, int).reshape(shape) if welds else None
        sizes = np.cumsum([shape[0] * shape[1], shape[0], 10 * shape[0] * shape[1]])
        self._state = np.concatenate([np.zeros(sizes[2]), model.eq_data[welds].ravel()])
        touched, self._holder, grip, weld_data = np.split(self._state, sizes)
        self._touched = touched.reshape(shape)  # how often in succession both fingers were seen to touch
        self._holder[:] = -1.0  # index of an arm
        # where the fingers took hold: in the object, and in the left finger; the object's orientation in that
        # finger
        self._grip = grip.reshape(*shape, 10)
        self._weld_data = weld_data.reshape(-1, model.eq_data.shape[1])
        joints = [int(model.joint(thing).qposadr[0]) + ROS_ORDER for thing in things]
        self._where, self._positions = np.array(joints, int).reshape(-1, 7), data.qpos
        self._poses, self._values = np.zeros((len(things), 7)), np.zeros((len(things), 4))
        self._height = data.xpos[self._bodies, 2].copy()
        self.outputs: dict[str, Vector] = {}
        for i, thing in enumerate(things):
            values = {
                f"{thing}/{name}": self._values[i, k : k + 1]
                for k, name in enumerate(("held_by", "slip", "turn", "lift"))
            }
            self.outputs |= {f"{thing}/pose": self._poses[i], **values}

    def update(self) -> None:
        """Read the contacts, set welds, and update the outputs."""
        if self._bodies:
            self.watch()
            self.refresh()

    def are_near(self, positions: Vector, count: int) -> Sequence[bool]:
        """Return whether a finger may touch an object at each of `count` instants.

        `positions`: of all bodies, m, shape (instants, bodies, 3). True where positions are missing.
        """
        if not self._bodies or not self._arms:
            return [False] * count
        things, fingers, reach = self._reach
        apart = np.linalg.norm(positions[:, things] - positions[:, fingers], axis=-1)
        near: list[bool] = (apart < reach).any(axis=-1).tolist()
        return near + [True] * (count - len(near))

    def watch(self, *, near: bool = True) -> None:
        """Read the contacts, and set welds; outputs stay as they are.

        `near`: whether a finger may touch an object at all.
        """
        if not near:
            self._contacts.fill(0.0)
        if (near and self._look()) or self._touched.any():  # an object is held no longer than it is touched
            touch = (self._contacts[..., 0] > 0.0).all(axis=-1)
            self._touched += 1.0
            self._touched *= touch
            for i, j in np.argwhere(self._touched == self._settled):
                self._begin_hold(i, j)
            if self._welds is not None:
                self._data.eq_active[self._welds[~touch]] = 0
            for i in range(len(self._bodies)):
                self._choose_holder(i)

    def _look(self) -> bool:
        """Count the contacts of every finger with every object, and sum their positions.

        Returns whether there are any. In Python and once per update: 36 contact sensors of a full cart with
        six objects cost MuJoCo a twentieth of every sub-step.
        """
        if self._rays is not None:
            return self._rays.look(self._contacts, self._touched)
        self._contacts.fill(0.0)
        contact, ends, found = self._data.contact, self._ends, False
        pairs: list[tuple[int, int]] = contact.geom.tolist()
        for at, (one, other) in enumerate(pairs):
            if ends[one] * ends[other] < 0:
                finger, thing = sorted((ends[one], ends[other]))
                self._contacts[thing - 1, *divmod(-finger - 1, 2)] += (1.0, *contact.pos[at])
                found = True
        return found

    def refresh(self) -> None:
        """Update the outputs to the model's present state."""
        # three times as fast as the default mode
        self._positions.take(self._where, None, self._poses, "clip")
        np.subtract(self._poses[:, 2], self._height, out=self._values[:, 3])
        self._values[:, :3] = 0.0
        for i, holder in enumerate(map(int, self._holder.tolist())):
            if holder >= 0:
                self._values[i, :3] = self._numbers[holder], self._grip_slip(i, holder), self._turn(i, holder)

    def holder(self, thing: str) -> str | None:
        """Return the holding arm of an object, the first of two; None without."""
        holder = int(self._holder[self._things[thing]])
        return self._arms[holder].partition("/")[0] if holder >= 0 else None

    def _choose_holder(self, i: int) -> None:
        """Keep the holding arm of object `i` while holding; then choose the first holding arm."""
        holding = self._touched[i] >= self._settled
        holder = int(self._holder[i])
        if holder < 0 or not self._touched[i, holder]:
            self._holder[i] = int(np.argmax(holding)) if holding.any() else -1

    def _begin_hold(self, i: int, j: int) -> None:
        data, body, finger = self._data, self._bodies[i], self._fingers[j]
        contacts = self._contacts[i, j]
        point = (contacts[:, 1:] / contacts[:, :1]).mean(axis=0)
        self._grip[i, j, :3] = data.xmat[body].reshape(3, 3).T @ (point - data.xpos[body])
        self._grip[i, j, 3:6] = data.xmat[finger].reshape(3, 3).T @ (point - data.xpos[finger])
        self._grip[i, j, 6:] = self._orientation(i, j)
        if self._welds is not None:
            wrist, weld = self._wrists[j], self._welds[i][j]
            position, turn, back = np.zeros(3), np.zeros(4), np.zeros(4)
            mujoco.mju_negQuat(back, data.xquat[wrist])
            mujoco.mju_rotVecQuat(position, data.xpos[body] - data.xpos[wrist], back)
            mujoco.mju_mulQuat(turn, back, data.xquat[body])
            self._model.eq_data[weld, :3], self._model.eq_data[weld, 3:10] = 0.0, [*position, *turn]
            self._weld_data[i * len(self._fingers) + j] = self._model.eq_data[weld]
            data.eq_active[weld] = 1

    def _grip_slip(self, i: int, j: int) -> float:
        data, body, finger = self._data, self._bodies[i], self._fingers[j]
        point = data.xpos[body] + data.xmat[body].reshape(3, 3) @ self._grip[i, j, :3]
        return float(
            np.linalg.norm(
                data.xmat[finger].reshape(3, 3).T @ (point - data.xpos[finger]) - self._grip[i, j, 3:6]
            )
        )

    def _turn(self, i: int, j: int) -> float:
        """Return the turn (rad) of object `i` in the left finger of arm `j` while held."""
        w = abs(float(self._grip[i, j, 6:] @ self._orientation(i, j)))
        return 2.0 * acos(min(w, 1.0))

    def _orientation(self, i: int, j: int) -> Vector:
        """Return the orientation of object `i` in the left finger of arm `j`, quaternion (w, x, y, z)."""
        back, turn = np.zeros(4), np.zeros(4)
        mujoco.mju_negQuat(back, self._data.xquat[self._fingers[j]])
        mujoco.mju_mulQuat(turn, back, self._data.xquat[self._bodies[i]])
        return turn

    @property
    def state(self) -> Vector:
        """State beyond MuJoCo's; the same array at every call."""
        return self._state

    @state.setter
    def state(self, state: Vector) -> None:
        self._state[:] = state
        if self._welds is not None:
            self._model.eq_data[self._welds.ravel()] = self._weld_data


def _reaches(model: mujoco.MjModel, ends: Sequence[int]) -> tuple[NDArray[np.intp], NDArray[np.intp], Vector]:
    """Return pairs of bodies, an object's and a finger's, and the distance within which a pair may touch."""
    radius: dict[int, float] = {}
    owner: dict[int, int] = {}
    for geom, end in enumerate(ends):
        if end:
            body = int(model.geom_bodyid[geom])
            size = float(np.linalg.norm(model.geom_pos[geom]) + model.geom_rbound[geom])
            radius[body] = max(radius.get(body, 0.0), size + float(model.geom_margin[geom]))
            owner[body] = end
    pairs = [(i, j) for i in owner for j in owner if owner[i] > 0 > owner[j]]
    things, fingers = np.array(pairs, int).reshape(-1, 2).T
    return things, fingers, np.array([radius[i] + radius[j] for i, j in pairs])


def _ends(model: mujoco.MjModel, things: list[str], fingers: list[str]) -> list[int]:
    """Return the owner of every geom of `model`.

    i + 1 stands for object i, -(i + 1) for finger i or a pad on it, 0 for anything else.
    """
    ends = np.zeros(model.nbody, int)
    for sign, bodies in (1, things), (-1, fingers):
        for i, body in enumerate(bodies, 1):
            ends[model.body(body).id] = sign * i
    for body, parent in enumerate(model.body_parentid.tolist()):  # which comes before it
        if ends[parent] < 0:
            ends[body] = ends[parent]
    return ends[model.geom_bodyid].tolist()
