"""Saved states of several parts as one: their number, the length of each, and then the bytes."""

from __future__ import annotations

from itertools import accumulate

import numpy as np

from schemas.errors import StateError

__all__ = ["join_saved", "split_saved"]

_WORD = np.dtype("<i8")


def join_saved(*parts: bytes) -> bytes:
    """Return the parts of a saved state as one.

    Examples:
        state = join_saved(super().save(), self._surfaces.save())
        own, surfaces = split_saved(self.name, 2, state)
    """
    return b"".join([np.array([len(parts), *map(len, parts)], _WORD).tobytes(), *parts])


def split_saved(participant: str, count: int, state: bytes) -> list[bytes]:
    """Return the `count` parts that `join_saved` made one. Raises StateError if `state` is not of them."""
    length = _WORD.itemsize * (1 + count)
    head: list[int] = np.frombuffer(state[:length], _WORD).tolist() if len(state) >= length else []
    sizes = head[1:]
    if head[:1] != [count] or min(sizes, default=0) < 0 or len(state) != length + sum(sizes):
        raise StateError(
            f"participant '{participant}': a saved state of {len(state)} bytes, expected {count} parts and"
            " their lengths; was it saved elsewhere?"
        )
    ends = accumulate(sizes, initial=length)
    return [state[end : end + size] for end, size in zip(ends, sizes, strict=False)]
