"""Waiting for a condition, with a limit that other work on the machine does not reach."""

from time import monotonic, sleep

__all__ = ["LIMIT_S", "until"]

LIMIT_S = 120.0
"""Below the limit of a whole test (pyproject.toml); on an idle machine conditions hold within seconds."""


def until(condition, limit_s=LIMIT_S):
    """Return the first true value of `condition`. Raises TimeoutError if it stays false."""
    end = monotonic() + limit_s
    while not (found := condition()):
        if monotonic() > end:
            raise TimeoutError(f"still {found!r} after {limit_s:g} s")
        sleep(0.005)
    return found
