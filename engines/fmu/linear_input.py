"""Inputs of a bond: values with a slope within a communication step."""

from __future__ import annotations

from collections.abc import Callable

from engines.fmu.blocks import Block
from schemas.vectors import Vector

__all__ = ["LinearInput"]


class LinearInput:
    """Inputs that follow a line where the FMU interpolates, and else have the mean of the line."""

    def __init__(
        self,
        block: Block,
        transfer: Callable[[Block], None],
        slopes: Vector | None = None,
        set_slopes: Callable[[], None] | None = None,
    ) -> None:
        """`slopes` (1/s), with a call that sets them: for an FMU that interpolates inputs."""
        self._block, self._transfer = block, transfer
        self._slopes, self._set_slopes = slopes, set_slopes

    @property
    def is_exact(self) -> bool:
        """Whether the FMU interpolates: at the end of a step it has seen the value there."""
        return self._set_slopes is not None

    def write(self, begin: Vector, end: Vector, dt: float) -> None:
        """Set the line from `begin` to `end`, both in the FMU's unit, over `dt` seconds."""
        if self._slopes is None or self._set_slopes is None:
            self._block.values[:] = 0.5 * (begin + end)
            self._transfer(self._block)
            return
        self._block.values[:] = begin
        self._transfer(self._block)
        self._slopes[:] = (end - begin) / dt
        self._set_slopes()
