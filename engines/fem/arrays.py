"""Arrays as `_solid.c` reads them."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["aligned_floats", "aligned_integers", "in_blocks"]

_Number = TypeVar("_Number", bound=np.generic)

_ALIGNMENT = 16
"""Bytes: loads of four numbers at once need it."""


def in_blocks(values: NDArray[_Number], lanes: int) -> NDArray[_Number]:
    """Return rows of one element each as blocks with the elements in lanes, shape (b, columns, lanes)."""
    return values.reshape(-1, lanes, values.shape[1]).transpose(0, 2, 1)


def aligned_floats(values: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
    """Return an aligned copy in single precision."""
    found = _memory(4 * values.size).view(np.float32).reshape(values.shape)
    found[...] = values
    return found


def aligned_integers(values: NDArray[np.integer[Any]]) -> NDArray[np.int32]:
    """Return an aligned copy in 32 bits."""
    found = _memory(4 * values.size).view(np.int32).reshape(values.shape)
    found[...] = values
    return found


def _memory(size: int) -> NDArray[np.uint8]:
    """Return `size` bytes that begin at a multiple of `_ALIGNMENT`."""
    memory = np.zeros(size + _ALIGNMENT, np.uint8)
    start = -memory.ctypes.data % _ALIGNMENT
    return memory[start : start + size]
