"""Statistics of verdicts: intervals of success rates, and whether two policies differ.

Wilson's interval: E. B. Wilson, JASA 22 (1927). Paired difference of proportions: R. G. Newcombe, Statistics
in Medicine 17 (1998) 2635, method 10. Test: McNemar's, exact (binomial over the discordant pairs).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

from scipy.stats import binomtest

__all__ = ["CONFIDENCE", "PairedDifference", "Rate", "paired_difference", "success_rate"]

CONFIDENCE = 0.95
"""Confidence of all intervals."""


class Rate(NamedTuple):
    """A share of episodes, with its interval."""

    successes: int
    trials: int
    low: float
    high: float

    @property
    def value(self) -> float:
        """The share, 0 without episodes."""
        return self.successes / self.trials if self.trials else 0.0

    def __str__(self) -> str:
        return f"{self.successes} of {self.trials} ({self.low:.2f} to {self.high:.2f})"


def success_rate(successes: int, count: int) -> Rate:
    """Return the share with Wilson's interval; without episodes 0 to 1."""
    if not count:
        return Rate(0, 0, 0.0, 1.0)
    interval = binomtest(successes, count).proportion_ci(CONFIDENCE, method="wilson")
    return Rate(successes, count, float(interval.low), float(interval.high))


class PairedDifference(NamedTuple):
    """The second policy's success rate less the first one's, on the same seeds."""

    pairs: int
    only_first: int
    """Episodes in which only the first policy succeeds."""
    only_second: int
    difference: float
    low: float
    high: float
    p: float
    """Probability of discordant pairs as uneven as these, or more, if the policies were equal."""

    @property
    def is_real(self) -> bool:
        """Whether chance is an unlikely explanation."""
        return self.p < 1.0 - CONFIDENCE


def paired_difference(first: Sequence[bool], second: Sequence[bool]) -> PairedDifference:
    """Compare two policies on the same episodes, in the same order."""
    pairs = list(zip(first, second, strict=True))
    both = sum(a and b for a, b in pairs)
    only_first = sum(a and not b for a, b in pairs)
    only_second = sum(b and not a for a, b in pairs)
    count, discordant = len(pairs), only_first + only_second
    if not count:
        return PairedDifference(0, 0, 0, 0.0, -1.0, 1.0, 1.0)
    p = float(binomtest(only_first, discordant).pvalue) if discordant else 1.0
    low, high = _newcombe(both, only_first, only_second, count - both - discordant)
    return PairedDifference(count, only_first, only_second, (only_second - only_first) / count, low, high, p)


def _newcombe(both: int, only_first: int, only_second: int, none: int) -> tuple[float, float]:
    """Return the interval of the second share less the first."""
    count = both + only_first + only_second + none
    second = success_rate(both + only_second, count)
    first = success_rate(both + only_first, count)
    margins = (both + only_first) * (only_second + none) * (both + only_second) * (only_first + none)
    product = both * none - only_first * only_second
    if product > 0:
        product = max(product - count / 2.0, 0.0)
    phi = product / sqrt(margins) if margins else 0.0
    difference = second.value - first.value
    below = second.value - second.low, first.high - first.value
    above = second.high - second.value, first.value - first.low

    def spread(a: float, b: float) -> float:
        return sqrt(max(0.0, a * a - 2.0 * phi * a * b + b * b))

    return difference - spread(*below), difference + spread(*above)
