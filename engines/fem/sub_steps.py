"""Sub-steps of organs side by side: of one length, or longer by powers of two where an organ allows it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from math import ceil
from typing import NamedTuple

__all__ = ["SubSteps", "common_sub_steps", "own_sub_steps"]

_MOST_POWER = 3
"""Largest power of two between the forces of an organ."""
_SHARE = 0.75
"""Time between the forces of an organ over its longest sub-step: beyond, stiff organs beside it swing in
resonance with its pushes.
"""
_TIED = 2
"""Largest ratio of sub-steps of organs that hang together: beyond, their ties bear less than their strength.
"""
_CONTACT_SHARE = 0.2
"""Cost of contacts in a sub-step over that of the forces of all elements."""


class SubSteps(NamedTuple):
    """Sub-steps of a step."""

    total: int
    every: tuple[int, ...]
    """Sub-steps between the forces of the elements of each organ."""


def common_sub_steps(seconds: float, longest: Sequence[float], fewest: int = 1) -> SubSteps:
    """Return sub-steps of one length for all organs.

    longest: longest sub-step of each, s. fewest: least number of sub-steps.
    """
    return SubSteps(max(fewest, *(ceil(seconds / one) for one in longest)), (1,) * len(longest))


def own_sub_steps(
    seconds: float,
    longest: Sequence[float],
    fewest: int,
    nodes: Sequence[int],
    tied: Collection[tuple[int, int]] = (),
) -> SubSteps:
    """Return the cheapest sub-steps for organs of so many nodes each.

    longest, fewest: as above. tied: pairs of organs that hang together, by number.
    """
    plans = [_with_multiple(2**power, fewest, seconds, longest, tied) for power in range(_MOST_POWER + 1)]
    return min(plans, key=lambda plan: _cost(plan, nodes))


def _with_multiple(
    multiple: int, least: int, seconds: float, longest: Sequence[float], tied: Collection[tuple[int, int]]
) -> SubSteps:
    """Return a plan of at least so many sub-steps, a multiple of this power of two."""
    count = -(-least // multiple) * multiple
    allowed = (max(1, min(multiple, int(_SHARE * one * count / seconds))) for one in longest)
    every = [1 << (one.bit_length() - 1) for one in allowed]
    for _ in every:  # a limit passes on from organ to organ
        for one, other in tied:
            every[one] = min(every[one], _TIED * every[other])
            every[other] = min(every[other], _TIED * every[one])
    return SubSteps(count, tuple(every))


def _cost(plan: SubSteps, nodes: Sequence[int]) -> float:
    """Return about how many nodes are served in a step."""
    forces = sum(own / every for own, every in zip(nodes, plan.every, strict=True))
    return plan.total * (forces + _CONTACT_SHARE * sum(nodes))
