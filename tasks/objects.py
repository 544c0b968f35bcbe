"""Events of the objects of a task: grasps, places, falls."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from hub.participant import Record, array, number
from schemas.vectors import Vector
from tasks.events import Event
from tasks.instant import Instant
from tasks.params import TaskParams

__all__ = ["CONTACT_GAP", "ObjectWatch"]

_REST_SPEED = 5e-3
"""Largest speed of a released object at rest, m/s."""
_REST_TIME = 0.1
"""Time at rest of a released object, s; shorter rests are reversals of motion."""
_FALL_TIME = 1.0
"""Time after the release until a rolling object counts as dropped, s."""
CONTACT_GAP = 0.1
"""Longest gap within a contact of instruments, s."""


class ObjectsState(Record):
    """State of each object at the last instant."""

    holder = array("objects")
    """Index of an arm, -1: none."""
    base = array("objects")
    """Height at the grasp, m."""
    lifted = array("objects")
    free = array("objects")
    """Time since the release, s; -1: held, or at rest at its place."""
    rest = array("objects")
    """Time at rest of a released object, s."""
    release = array("objects")
    """Height at the release, m."""
    releaser = array("objects")
    before = array("objects", 3)
    """Position at the last instant, m."""
    outside = array("objects")
    unseen = array("objects")
    impulse = number()
    """Impulse between instruments, N s."""
    contact_gap = number(CONTACT_GAP)
    """Time since instruments touched, s."""


class ObjectWatch:
    """Makes events from the motion of objects and instruments."""

    def __init__(
        self,
        count: int,
        params: TaskParams,
        workspace: Vector | None,
        place_of: Callable[[int, Vector], int],
    ) -> None:
        """Watch `count` objects.

        `workspace`: least and greatest coordinates, m, shape (2, 3); `place_of`: returns the place of an
        object at a pose, shape (7,), or -1.
        """
        self.state = ObjectsState(objects=count)
        self.state.holder[:] = self.state.free[:] = self.state.releaser[:] = -1.0
        self._params, self._workspace, self._place_of = params, workspace, place_of

    def start(self, now: Instant) -> None:
        """Begin with the objects at rest at the first instant."""
        self.state.before[:] = now.poses[:, :3]

    def observe(self, now: Instant) -> Iterator[Event]:
        """Yield the events of an instant."""
        state = self.state
        for i, (was, holder) in enumerate(zip(state.holder.astype(int), now.holders, strict=True)):
            height = float(now.poses[i, 2])
            if holder != was:
                yield from self._holder_change(i, was, holder, height)
            if holder >= 0:
                raised = height - state.base[i]
                if not state.lifted[i] and raised >= self._params.lift:
                    state.lifted[i] = 1.0
                    yield Event("lifted", i, holder, value=raised, unit="m")
            elif state.free[i] >= 0.0:
                yield from self._settle(i, now)
            yield from self._leave(i, now)
        state.before[:] = now.poses[:, :3]
        yield from self._instrument_contacts(now)

    def _holder_change(self, i: int, was: int, holder: int, height: float) -> Iterator[Event]:
        state = self.state
        state.holder[i] = holder
        if holder < 0:
            state.free[i], state.rest[i], state.release[i], state.releaser[i] = 0.0, 0.0, height, was
            return
        state.free[i] = -1.0
        if was >= 0:
            yield Event("handed over", i, holder)
        else:
            state.base[i], state.lifted[i] = height, 0.0
            yield Event("grasped", i, holder)

    def _settle(self, i: int, now: Instant) -> Iterator[Event]:
        """Wait until a released object lies still, and see where."""
        state, pose = self.state, now.poses[i]
        state.free[i] += now.period_s
        still = np.linalg.norm(pose[:3] - state.before[i]) < _REST_SPEED * now.period_s
        state.rest[i] = state.rest[i] + now.period_s if still else 0.0
        if state.rest[i] < _REST_TIME and state.free[i] < _FALL_TIME:
            return
        state.free[i] = -1.0
        arm, fallen = int(state.releaser[i]), float(state.release[i] - pose[2])
        place = self._place_of(i, pose)
        if place >= 0:
            yield Event("placed", i, arm, place)
        elif fallen >= self._params.drop:
            yield Event("dropped", i, arm, value=fallen, unit="m")

    def _leave(self, i: int, now: Instant) -> Iterator[Event]:
        """Check whether an object has left the workspace, or the endoscope's view."""
        state, position = self.state, now.poses[i, :3]
        if self._workspace is not None:
            low, high = self._workspace
            outside = bool((position < low).any() or (position > high).any())
            if outside and not state.outside[i]:
                yield Event("out of workspace", i)
            state.outside[i] = outside
        unseen = not now.things_seen[i]
        if unseen and not state.unseen[i]:
            yield Event("out of view", i)
        state.unseen[i] = unseen

    def _instrument_contacts(self, now: Instant) -> Iterator[Event]:
        """Check for contact between instruments."""
        state, more = self.state, now.impulse - self.state.impulse
        state.contact_gap += now.period_s
        if more > 0.0:
            if state.contact_gap >= CONTACT_GAP:
                yield Event("collision", value=more, unit="N*s")
            state.contact_gap, state.impulse = 0.0, now.impulse
