"""The thread of the pad's needle: pulled into channels, held there, and shown as a tube."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engines.suture_pad import tube
from engines.suture_pad.channel import SPACING, ChannelState, Phase
from engines.suture_pad.passages import Passages
from engines.suture_pad.rod import Rod
from engines.suture_pad.tissue import TissueParams
from hub.participant import Record, flag
from robots.training.needles import NeedleShape
from robots.training.threads import ThreadParams
from schemas.vectors import Vector

__all__ = ["DrawnThread"]

_APART = 1.0e-3
"""Distance of neighbouring points of a passage, m."""


class DrawnState(Record):
    """State of the thread beside passages and shape."""

    drawn = flag()
    """Whether the thread is in the needle's present channel."""


class DrawnThread:
    """The thread of the pad's needle. Everything is in the frame `pad`."""

    def __init__(self, thread: ThreadParams, needle: NeedleShape, tissue: TissueParams, depth: float) -> None:
        """Hide the thread in a pad of `depth` metres until the needle's place is known."""
        self._thread, self._needle = thread, needle
        self._base, self._forward = (needle.frames["base"][:3, at].copy() for at in (3, 1))
        self._passages, self._state = Passages(thread, tissue), DrawnState()
        self._rod = Rod(thread, -depth / 2.0)
        self._where = np.zeros(3), np.zeros(3)

    @property
    def count(self) -> int:
        """How many channels the thread runs through."""
        return self._passages.state.count

    @property
    def pull(self) -> float:
        """Size of the force on the needle's base, N."""
        return self._passages.pull

    def follow(self, rotation: Vector, origin: Vector, channel: ChannelState) -> tuple[Vector, Vector]:
        """Follow the needle to a pose; return the force (N) of the thread on the needle, and its place (m).

        Args:
            rotation: rotation of the needle, shape (3, 3).
            origin: origin of the needle's frame, m.
            channel: the needle's channel.
        """
        base, forward = rotation @ self._base + origin, rotation @ self._forward
        self._where = base, forward
        state, passages = self._state, self._passages
        inserted = channel.length - self._needle.length
        if channel.phase is not Phase.THROUGH:
            state.drawn = False
        elif inserted > 0.0 and not state.drawn and not passages.is_full:
            state.drawn = True
            every = round(_APART / SPACING)
            row = [*channel.points[: max(1, channel.count - 1) : every], channel.came_out]
            passages.open(np.array(row), inserted)
        force = passages.advance(base, forward, inserted if state.drawn else None)
        state.drawn = state.drawn and inserted > 0.0
        return force, base

    def settle(self, dt: float) -> None:
        """Let the free parts hang, lie or be pulled, for `dt` seconds."""
        self._rod.settle(*self._where, list(self._passages), dt)

    @property
    def nodes(self) -> Vector:
        """The thread from the needle's base on, m, shape (n + 1, 3)."""
        return self._rod.state.nodes

    def tube(self) -> Vector:
        """Return the nodes of the surface, m."""
        return tube.surface(self.nodes, self._thread.radius)

    def triangles(self) -> NDArray[np.uint32]:
        """Return the triangles of the surface, node indices, shape (f, 3), counter-clockwise from outside."""
        return tube.triangles(self._thread.segments)

    @property
    def parts(self) -> tuple[Vector, ...]:
        """All arrays of the state."""
        return (self._state.values, self._passages.state.values, self._rod.state.values)

    def restore(self, parts: list[Vector]) -> None:
        """Return to a saved state; raises StateError for an impossible state."""
        for record, values in zip((self._state, self._passages.state, self._rod.state), parts, strict=True):
            record.check(values)
            record.values[:] = values
        self._passages.refresh()
