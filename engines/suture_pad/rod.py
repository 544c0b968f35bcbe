"""The shape of a thread: an inextensible elastic rod, too light to pull. SI units.

Nodes are equally far apart along the thread. Some are held: the node at the needle's base, a virtual node
ahead of the base in the needle, and nodes in a passage. The parts between, before and behind passages are
spans, from one fixed place of the thread to the next. A span as long as its distance is straight. Any other
span takes a step of backward Euler, without mass:

    (1 + dt E I / (c h^4) D2' D2) x = x_before - dt * sinking z,    |edges| = their lengths

with D2 the second differences of the nodes. Lengths are kept by Newton's method on the multipliers, in the
metric of the left side, so bending does not act against the lengths. No free node is below the skin's level.
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
"""Distance of a node held by a passage, in segments along the thread: edges have some length."""
_TAUT = 1e-3
"""Largest relative slack of a straight span."""
_EXACT = 2e-6
"""Tolerance of an edge's length, m."""
_MOST_STEPS = 20
"""Most steps of Newton's method: three are common."""
_SOFTNESS = 1e-4
"""Softness of the multipliers, relative to their diagonal: else a nearly straight span has an edge too many.
"""


class RodState(Record):
    """Where the thread is."""

    is_laid = flag()
    """Whether the thread has been laid out behind the needle."""
    nodes = array("nodes", 3)
    """Nodes from the needle's base on, m, frame `pad`."""


class Span(NamedTuple):
    """A part of the thread between two fixed places, as lengths along the thread from the base, m."""

    start: float
    end: float
    place: Vector
    """Place of the start, m, shape (3,)."""
    end_place: Vector | None
    """Place of the end, m, shape (3,); None: the thread's free end."""


class Rod:
    """The nodes of a thread."""

    def __init__(self, thread: ThreadParams, hidden: float) -> None:
        """Lay the thread out at a height (m, frame `pad`) until the needle's place is known."""
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
            base: base of the needle, m, frame `pad`.
            forward: unit vector from the base into the needle, frame `pad`.
            passages: passages of the thread, from the newest on.
            dt: duration of the step, s.
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
        for span in self._thread_spans(base, passages):
            self._take(span, held, nodes, dt)
        state.nodes[:] = nodes[1:]

    def _thread_spans(self, base: Vector, passages: Sequence[Passage]) -> list[Span]:
        """Return the parts outside of passages, from the needle's base on."""
        spans: list[Span] = []
        start, place = 0.0, base
        for passage in passages:
            spans.append(Span(start, passage.through - passage.length, place, passage.points[-1]))
            start, place = passage.through, passage.points[0]
        return [*spans, Span(start, self._thread.length, place, None)]

    def _take(self, span: Span, held: NDArray[np.bool_], nodes: Vector, dt: float) -> None:
        """Move the nodes of a span not `held` by passages.

        `nodes` begins with the virtual node ahead of the base.
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
        """Return the span between the nodes held just outside of passages, and the span's free nodes."""
        if len(within) and held[within[0]]:
            span = span._replace(start=float(self._ways[within[0]]), place=nodes[within[0] + 1])
            within = within[1:]
        if len(within) and held[within[-1]]:
            span = span._replace(end=float(self._ways[within[-1]]), end_place=nodes[within[-1] + 1])
            within = within[:-1]
        return span, within


def _kept(span: Span, ways: Vector, nodes: Vector, weights: Vector) -> Vector:
    """Return the nodes (m), shape (n, 3), with edges of exact length and no node below the level.

    Args:
        span: span of the nodes.
        ways: lengths along the thread to the nodes, m, shape (n,).
        nodes: unconstrained nodes, m, shape (n, 3).
        weights: displacement of a node per force on another node, shape (n, n).
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
