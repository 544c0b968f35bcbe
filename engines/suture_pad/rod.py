"""The shape of a thread: an elastic rod that does not stretch and is too light to pull. SI units.

Its nodes are equally far apart along it. Some are held: that at the needle's base, the one that would be
ahead of it in the needle, and those that lie in a passage. What is between two passages, or before or behind
all, is a span, from one place that the thread runs through to the next. A span that is as long as the way is
straight. Any other takes a step of backward Euler, without mass:

    (1 + dt E I / (c h^4) D2' D2) x = x_before - dt * sinking z,    |edges| = their lengths

with D2 the second differences of the nodes. Lengths are kept by Newton's method on their multipliers, in the
metric of the left side, so that bending does not fight them. No free node is below the skin's level.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engines.suture_pad.passages import Passage
from hub.participant import Record, array, flag
from robots.training.threads import ThreadParams
from schemas.vectors import Vector

__all__ = ["Rod", "RodState"]

_BESIDE = 0.2
"""A node so near to a passage, in segments along the thread, is held by it: edges have some length."""
_TAUT = 1e-3
"""By which share a span is longer than the way and still straight."""
_EXACT = 2e-6
"""By how much an edge may be too long or short, m."""
_MOST_STEPS = 20
"""Of Newton's method: three are common."""
_SOFTNESS = 1e-4
"""Of the multipliers, as a share of their diagonal: else a nearly straight span has an edge too many."""


class RodState(Record):
    """Where the thread is."""

    is_laid = flag()
    """Whether it has been laid out behind its needle."""
    nodes = array("nodes", 3)
    """From the needle's base on, m, frame `pad`."""


class Span(NamedTuple):
    """A part of the thread between two places that it runs through, in ways along it from the base, m."""

    start: float
    end: float
    place: Vector
    """Of its start, m, shape (3,)."""
    end_place: Vector | None
    """Of its end, m, shape (3,); None: the thread's end, which is free."""


class Rod:
    """The nodes of one thread."""

    def __init__(self, thread: ThreadParams, hidden: float) -> None:
        """Lay the thread out at a height (m, frame `pad`) until it is known where the needle is."""
        self._thread = thread
        count = thread.segments + 1
        self.state = RodState(nodes=count)
        self._ways: Vector = thread.segment * np.arange(count, dtype=np.float64)
        self.state.nodes[:, 0], self.state.nodes[:, 2] = self._ways, hidden
        bends = np.diff(np.eye(count + 1), n=2, axis=0)  # (n - 1, n + 1), the first node is ahead of the base
        self._bending: Vector = thread.relaxation / thread.segment**4 * (bends.T @ bends)

    def settle(self, base: Vector, forward: Vector, passages: Sequence[Passage], dt: float) -> None:
        """Take a step of `dt` seconds.

        Args:
            base: of the needle, m, frame `pad`.
            forward: from the base into the needle, unit vector, frame `pad`.
            passages: that the thread runs through, from the newest on.
            dt: s.
        """
        state, thread = self.state, self._thread
        if not state.is_laid:
            state.is_laid = True
            state.nodes[:] = base - self._ways[:, None] * forward
            np.maximum(state.nodes[:, 2], 0.0, out=state.nodes[:, 2])
        state.nodes[0] = base
        held = np.zeros(len(self._ways), np.bool_)
        for passage in passages:
            ways = passage.through - self._ways
            beside = _BESIDE * thread.segment
            inside = (ways >= -beside) & (ways <= passage.length + beside)
            inside[0] = False
            state.nodes[inside] = passage.at(ways[inside])
            held |= inside
        nodes = np.concatenate([[base + thread.segment * forward], state.nodes])
        for span in self._spans(base, passages):
            self._take(span, held, nodes, dt)
        state.nodes[:] = nodes[1:]

    def _spans(self, base: Vector, passages: Sequence[Passage]) -> list[Span]:
        """Return the parts that are outside of passages, from the needle's base on."""
        spans: list[Span] = []
        start, place = 0.0, base
        for passage in passages:
            spans.append(Span(start, passage.through - passage.length, place, passage.points[-1]))
            start, place = passage.through, passage.points[0]
        return [*spans, Span(start, self._thread.length, place, None)]

    def _take(self, span: Span, held: NDArray[np.bool_], nodes: Vector, dt: float) -> None:
        """Move the nodes of a span that passages have not `held`.

        `nodes` has the one ahead of the base before all others.
        """
        within = np.flatnonzero((self._ways > span.start) & (self._ways <= span.end))
        if span.end_place is not None:
            way, length = span.end_place - span.place, span.end - span.start
            if length <= (1.0 + _TAUT) * float(np.sqrt(way @ way)):
                shares = (self._ways[within] - span.start) / max(length, 1e-12)
                nodes[within + 1] = span.place + shares[:, None] * way
                return
        span, free = self._between_held(span, within, held, nodes)
        if not len(free):
            return
        ways, at = self._ways[free], free + 1
        around = nodes.copy()
        around[at] = 0.0
        sunk = nodes[at]
        sunk[:, 2] = np.maximum(sunk[:, 2] - dt * self._thread.sinking, np.minimum(sunk[:, 2], 0.0))
        system = np.eye(len(at)) + dt * self._bending[np.ix_(at, at)]
        weights = np.linalg.inv(system).astype(np.float64)
        nodes[at] = weights @ (sunk - dt * self._bending[at] @ around)
        nodes[at] = _kept(span, ways, nodes[at], weights)

    def _between_held(
        self, span: Span, within: NDArray[np.int64], held: NDArray[np.bool_], nodes: Vector
    ) -> tuple[Span, NDArray[np.int64]]:
        """Return the span between nodes that its passages hold just outside of them, and its free nodes."""
        if len(within) and held[within[0]]:
            span = span._replace(start=float(self._ways[within[0]]), place=nodes[within[0] + 1])
            within = within[1:]
        if len(within) and held[within[-1]]:
            span = span._replace(end=float(self._ways[within[-1]]), end_place=nodes[within[-1] + 1])
            within = within[:-1]
        return span, within


def _kept(span: Span, ways: Vector, nodes: Vector, weights: Vector) -> Vector:
    """Return the nodes (m), shape (n, 3), so that edges have their lengths and none is below the level.

    Args:
        span: that they are of.
        ways: of the nodes along the thread, m, shape (n,).
        nodes: where they would be without.
        weights: by how much a force on one moves another, shape (n, n).
    """
    ends = [] if span.end_place is None else [span.end_place]
    points: Vector = np.concatenate([[span.place], nodes, np.array(ends).reshape(-1, 3)])
    lengths = np.diff(np.concatenate([[span.start], ways, [span.end] * len(ends)]))
    moved = np.zeros((len(points), len(points)))
    inner = slice(1, len(nodes) + 1)
    moved[inner, inner] = weights
    columns = np.diff(moved, axis=1)  # by how much a force along an edge moves the points
    coupling = np.diff(columns, axis=0)
    soft = np.diag(_SOFTNESS * np.diag(coupling))
    for _ in range(_MOST_STEPS):
        np.maximum(points[inner, 2], 0.0, out=points[inner, 2])
        edges: Vector = np.diff(points, axis=0)
        now: Vector = np.sqrt((edges * edges).sum(axis=1))
        wrong = now - lengths
        if float(np.abs(wrong).max()) < _EXACT:
            break
        along: Vector = edges / np.maximum(now, 1e-12)[:, None]
        forces = np.linalg.solve(coupling * (along @ along.T) + soft, wrong).astype(np.float64)
        points -= columns @ (forces[:, None] * along)
    return points[inner]
