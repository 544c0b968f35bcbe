"""Sums of floats with the same bits on every version of Python."""

from __future__ import annotations

from collections.abc import Iterable
from functools import reduce
from operator import add


def plain_sum(values: Iterable[float]) -> float:
    """Return the sum of `values`, added from the first to the last.

    `sum` compensates its rounding errors since Python 3.12, so state hashes would depend on the version.
    """
    return reduce(add, values, 0.0)
