"""Blocks of variables set or got together: in one compiled call where there is one, else block by block."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from engines.fmu.blocks import WARNING, Block
from hub.participant import Inputs
from schemas.vectors import Vector

try:
    from engines.fmu import _calls as compiled
except ImportError:  # there was no compiler: the same bits, more slowly
    compiled = None

if TYPE_CHECKING:
    from engines.fmu.instance import Instance

__all__ = ["Stop", "Transfers", "compiled"]

Stop = tuple[int, int] | None
"""Block at which a transfer stopped, and the FMU's status; None: it got to the end."""


class Transfers:
    """Blocks of an instance, all inputs or all outputs, in this order."""

    def __init__(self, instance: Instance, blocks: Sequence[Block]) -> None:
        """Prepare the calls."""
        self._instance = instance
        self._blocks = blocks
        self.compiled = None
        """The same for compiled calls, if there are any."""
        if compiled is not None:
            self.compiled = compiled.Blocks(instance.component, tuple(map(self._buffers, blocks)))

    def set(self, inputs: Inputs, tau: float) -> None:
        """Set the inputs `tau` seconds after the start of the step; whole numbers only if one has changed."""
        if self.compiled is None or type(inputs) is not Inputs:
            for block in self._blocks:
                self._store(block, inputs, tau)
        elif (stop := self.compiled.set(*inputs.containers, tau, 0)) is not None:
            self.go_on(*stop, inputs, tau)

    def go_on(self, at: int, status: int, inputs: Inputs, tau: float) -> None:
        """Go on with the inputs after a compiled call that stopped at block `at` with the FMU's `status`."""
        assert self.compiled is not None
        stop = (at, status)
        while stop is not None:
            at, status = stop
            if status:
                raise self._instance.refusal(self._blocks[at], status)
            self._store(self._blocks[at], inputs, tau)
            stop = self.compiled.set(*inputs.containers, tau, at + 1)

    def get(self) -> Stop:
        """Get the outputs, as doubles; return where that stopped."""
        if self.compiled is not None:
            return self.compiled.get()
        for at, block in enumerate(self._blocks):
            if (status := block.call()) > WARNING:
                return at, status
            if not block.publish():
                return at, 0
        return None

    def refuse(self, at: int, status: int) -> NoReturn:
        """Raise the error of a `get` that stopped at block `at` with the FMU's `status`."""
        if status:
            raise self._instance.refusal(self._blocks[at], status)
        raise self._blocks[at].unusable()

    def _store(self, block: Block, inputs: Inputs, tau: float) -> None:
        block.store(inputs, tau)
        self._instance.set_changed(block)

    def forget(self) -> None:
        """Take all inputs as changed: the FMU has another state."""
        for block in self._blocks:
            block.forget()
        if self.compiled is not None:
            self.compiled.forget()

    def _buffers(
        self, block: Block
    ) -> tuple[int, bool, bytes, NDArray[Any], Vector, bool, tuple[tuple[str, int], ...]]:
        return (
            self._instance.address(block.function),
            self._instance.counted,
            np.array(block.references, np.uint32).tobytes(),
            block.raw,
            block.values,
            block.discrete,
            tuple((port, part.stop - part.start) for port, part in block.parts.items()),
        )
