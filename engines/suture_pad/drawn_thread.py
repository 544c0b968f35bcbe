"""The thread's side of the pad: its bond, and when the needle draws it into a channel."""

from __future__ import annotations

import numpy as np

from engines.suture_pad.channel import SPACING, ChannelState, Phase
from engines.suture_pad.params import SuturePadParams
from engines.suture_pad.passages import APART, Passages
from engines.suture_pad.ports import thread_side
from hub.participant import BondPlan, ForceSide, Inputs, Record, flag
from robots.dvrk.cart import inverse_pose
from robots.training.needles import NeedleShape
from robots.training.threads import ThreadParams
from schemas.vectors import Vector

__all__ = ["DrawnThread"]


class DrawnState(Record):
    """What the thread remembers beside its passages."""

    drawn = flag()
    """Whether it has been drawn into the channel that the needle is in."""


class DrawnThread:
    """The thread of the pad's needle, and the force side of its bond."""

    def __init__(self, thread: ThreadParams, needle: NeedleShape, params: SuturePadParams) -> None:
        self._thread, self._needle = thread, needle
        self._passages, self._state = Passages(thread, params.tissue), DrawnState()
        self._world_in_pad = inverse_pose(params.phantom.pose)
        self._nothing = np.zeros(3 * thread.segments)
        self._pushed = self._nothing
        self._side: ForceSide | None = None
        self.pull = 0.0
        """Size of the force of all channels on the thread in the last step, N."""

    @property
    def count(self) -> int:
        """How many channels the thread runs through."""
        return int((self._passages.state.counts > 0.0).sum())

    def couple(self, plan: BondPlan | None) -> None:
        """Take the bond as it was planned; None: the thread has none, and no tissue holds it."""
        self._side = None if plan is None else ForceSide(thread_side(self._thread.segments), plan)

    @property
    def outputs(self) -> dict[str, Vector]:
        """What the bond's outputs are before the first step."""
        side = self._side
        return {} if side is None else {side.force_port: self._nothing.copy(), side.work_port: np.zeros(1)}

    def begin(self, inputs: Inputs, h: int) -> None:
        """Begin a step of `h` nanoseconds."""
        self._pushed = self._nothing
        if self._side is not None:
            self._side.begin(inputs, h * 1e-9)

    def push(self, base: Vector, channel: ChannelState, tau: float, dt: float) -> Vector:
        """Take a sub-step of `dt` seconds about `tau`, and return the force (N) of the base on the pad.

        Args:
            base: of the needle, m in the world, shape (3,).
            channel: that the needle is in.
            tau: middle of the sub-step, s since the step began.
            dt: its length, s.
        """
        if self._side is None:
            return np.zeros(3)
        self._draw(channel)
        rotation, shift = self._world_in_pad[:3, :3], self._world_in_pad[:3, 3]
        nodes = self._side.position(tau).reshape(-1, 3)
        forces = self._passages.advance(np.concatenate([base[None], nodes]) @ rotation.T + shift)
        self.pull = float(np.linalg.norm(forces.sum(axis=0)))
        on_pad: Vector = -forces @ rotation
        self._pushed = on_pad[1:].ravel()
        self._side.add(self._pushed, self._nothing, tau, dt)
        return on_pad[0]

    def _draw(self, channel: ChannelState) -> None:
        """Open a passage once the base of a needle that is through has gone well into its channel.

        Less deep, a base that is a little behind where the needle's mean is would be outside of it again.
        """
        through = channel.length - self._needle.length
        if channel.phase is not Phase.THROUGH:
            self._state.drawn = False
        elif through > 2.0 * APART and not self._state.drawn:
            self._state.drawn = True
            every = round(APART / SPACING)
            self._passages.open(channel.points[: channel.count : every], through)

    def result(self) -> dict[str, Vector]:
        """Return the reaction of the step."""
        return {} if self._side is None else self._side.result(self._pushed, self._nothing)

    @property
    def parts(self) -> tuple[Vector, ...]:
        """All that it remembers."""
        side = () if self._side is None else (self._side.state,)
        return (self._state.values, self._passages.state.values, *side)

    def restore(self, parts: list[Vector]) -> None:
        """Return to what it remembered; raises StateError if it cannot have been that."""
        self._state.check(parts[0])
        self._passages.state.check(parts[1])
        self._state.values[:], self._passages.state.values[:] = parts[0], parts[1]
        self._passages.refresh()
        if self._side is not None:
            self._side.state = parts[2]
