"""The authors' rule of holding, without contact: an object on the ray ahead of a shut jaw is attached.

Source: unina-icaros/dvrk-vrep (commit 88fe597), dVRK-training_pick&place.ttt: the proximity sensors of TOOL1
and TOOL2 are rays of 8 mm from 5 mm ahead of the jaw, and the scripts attach the first object on the ray
while the jaw's command is at most 0, and release the object when the command is above. With a needle driver
we count from the wrist yaw axis, so the ray lies between the fingers and ends 2.8 mm ahead of the fingers;
with fingers of another length begin and end of the ray are as far from the ends of the fingers.
"""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from robots.dvrk.end_effectors.jaw import FINGERS
from schemas.vectors import Vector

__all__ = ["ProximityRays"]

_START, _RANGE = 5e-3, 8e-3
"""m, along the fingers of a needle driver from the wrist yaw axis."""
_DRIVER = 10.2e-3
"""Length of these fingers, m (robots.dvrk.instruments)."""


class ProximityRays:
    """The rays of some arms, and the objects in reach."""

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, things: list[str], jaws: Mapping[str, float]
    ) -> None:
        """Watch `things` from `jaws`: by arm, how long the fingers are, m."""
        self._model, self._data = model, data
        fingers = [model.actuator(f"{arm}/{FINGERS[0]}").id for arm in jaws]
        self._commands = [int(model.actuator_ctrladr[finger]) for finger in fingers]
        self._tips = [model.site(f"{arm}/tip").id for arm in jaws]
        self._starts = [_START + length - _DRIVER for length in jaws.values()]
        bodies = [model.body(thing).id for thing in things]
        self._geoms = [np.flatnonzero(model.geom_bodyid == body).tolist() for body in bodies]

    def look(self, contacts: Vector, held: Vector) -> bool:
        """Write whether and where each arm has each object, as a contact of both fingers.

        Args:
            contacts: count and sum of the positions (m), shape (things, arms, 2, 4).
            held: above 0 where the arm has had the thing, shape (things, arms).

        Returns whether any arm has anything.
        """
        contacts[:] = 0.0
        for j, tip in enumerate(self._tips):
            if self._data.ctrl[self._commands[j]] > 0.0:
                continue
            ahead = self._data.site_xmat[tip].reshape(3, 3)[:, 2].copy()
            start = self._data.site_xpos[tip] + self._starts[j] * ahead
            had = np.flatnonzero(held[:, j])
            found, distance = (int(had[0]), 0.0) if len(had) else self._first(start, ahead)
            if found >= 0:
                contacts[found, j] = (1.0, *(start + distance * ahead))
        return bool(contacts.any())

    def _first(self, start: Vector, ahead: Vector) -> tuple[int, float]:
        """Return the index of the first object on the ray, -1 for none, and the distance in metres."""
        model, data = self._model, self._data
        first, nearest = -1, _RANGE
        for i, geoms in enumerate(self._geoms):
            for geom in geoms:
                distance = mujoco.mju_rayGeom(
                    data.geom_xpos[geom],
                    data.geom_xmat[geom],
                    model.geom_size[geom],
                    start,
                    ahead,
                    int(model.geom_type[geom]),
                )
                if 0.0 <= distance < nearest:
                    first, nearest = i, distance
        return first, nearest
