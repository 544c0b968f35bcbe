"""Waiting for a condition, with a limit that other work on the machine does not reach."""

from time import sleep

__all__ = ["LIMIT_S", "until", "within"]

LIMIT_S = 120.0
"""Below the limit of a whole test (pyproject.toml); on an idle machine conditions hold within seconds."""
_NAP_S = 0.005


def within(condition, limit_s):
    """Return the last value of `condition`: the first true value, or a false value at the limit.

    The limit counts naps, not seconds of the clock: a machine that stood still has not waited.
    """
    for _ in range(round(limit_s / _NAP_S)):
        if found := condition():
            return found
        sleep(_NAP_S)
    return condition()


def until(condition, limit_s=LIMIT_S):
    """Return the first true value of `condition`. Raises TimeoutError if it stays false."""
    if not (found := within(condition, limit_s)):
        raise TimeoutError(f"still {found!r} after {limit_s:g} s")
    return found
