"""Variables of one FMI type, set or got in one call through buffers that are prepared once."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engines.fmu.variables import LARGEST_EXACT, Variable
from hub.participant import Inputs
from schemas.errors import SessionError
from schemas.vectors import Vector

__all__ = ["WARNING", "Access", "Block", "grouped", "prepared"]

WARNING = 1
"""The highest FMI status that lets a simulation go on (fmi2Status, fmi3Status: ok 0, warning 1, discard 2,
error 3, fatal 4).
"""

Access = Callable[[str, Sequence[int], NDArray[Any]], Callable[[], int]]
"""From a function's name such as `GetReal`, value references and a buffer to the prepared call, which returns
the FMI status.
"""


def prepared(
    function: Callable[..., int],
    component: int,
    references: Sequence[int],
    raw: NDArray[Any],
    *,
    counted: bool,
) -> Callable[[], int]:
    """Return the call of an FMI set or get function on buffer `raw`.

    `counted`: it takes the number of values as well (FMI 3).
    """
    pointer = raw.ctypes.data_as(ctypes.POINTER(np.ctypeslib.as_ctypes_type(raw.dtype)))
    count = len(references)
    return partial(
        function,
        component,
        (ctypes.c_uint * count)(*references),
        count,
        pointer,
        *([raw.size] if counted else []),
    )


def grouped(variables: Iterable[Variable]) -> Iterator[list[Variable]]:
    """Yield the variables that can go through one call.

    They have the same type, and all change at events only, or all at any time.
    """
    groups: dict[tuple[str, bool], list[Variable]] = {}
    for variable in variables:
        groups.setdefault((variable.type.name, variable.discrete), []).append(variable)
    yield from groups.values()


class Block:
    """Some variables of one type, all inputs or all outputs."""

    def __init__(self, verb: str, variables: Sequence[Variable], access: Access) -> None:
        """Prepare the calls on the variables; `verb` is `Set` or `Get`."""
        self.type = variables[0].type
        self.discrete = variables[0].discrete
        size = sum(variable.size for variable in variables)
        self.raw = np.zeros(size, self.type.dtype)
        """The values in their C type, shape (size,)."""
        self.values: Vector = self.raw if self.type.dtype == np.float64 else np.zeros(size)
        """The values as doubles, shape (size,)."""
        self._always_usable = self.type.dtype.kind != "f" and self.type.dtype.itemsize < self.values.itemsize
        self._taken = b""
        ends = np.cumsum([variable.size for variable in variables]).tolist()
        self.parts = {
            variable.port: slice(end - variable.size, end)
            for variable, end in zip(variables, ends, strict=True)
        }
        self._names = {variable.port: variable.name for variable in variables}
        self.function = function = verb + self.type.access
        """The FMI function without its prefix."""
        self.call = access(function, [variable.reference for variable in variables], self.raw)
        """Set or get all of them."""
        self._single = {
            v.name: access(function, [v.reference], self.raw[self.parts[v.port]]) for v in variables
        }

    @property
    def names(self) -> str:
        """The FMU's names of the variables, as text."""
        return ", ".join(self._names.values())

    def refused(self) -> str:
        """Return the name of the first variable that the FMU refuses to set or get.

        Called after the FMU has discarded a call on all of them.
        """
        return next((name for name, call in self._single.items() if call() > WARNING), self.names)

    def take(self, inputs: Inputs, tau: float) -> None:
        """Take the inputs as they are `tau` seconds after the start of the step.

        Inputs that change at events only are taken at the start of the step.
        """
        for port, part in self.parts.items():
            self.values[part] = inputs[port] if self.discrete else inputs.at(port, tau)
        # converting costs more than comparing
        if self.raw is not self.values and (taken := self.values.tobytes()) != self._taken:
            try:
                self.raw[:] = self.type.from_float64(self.values, self.names)
            except ValueError as error:
                raise SessionError(f"input {error}") from error
            self._taken = taken

    def publish(self) -> None:
        """Bring the outputs that the FMU has written from their C type to doubles.

        Raises SessionError if one of them is not a number that a port can carry.
        """
        if self.raw is not self.values:
            np.copyto(self.values, self.raw)
        if self._always_usable:
            return
        usable = (
            np.isfinite(self.values) if self.type.dtype.kind == "f" else np.abs(self.values) <= LARGEST_EXACT
        )
        if 0 in usable.tobytes():  # a third of the cost of usable.all()
            port, value = next(
                (port, self.values[part]) for port, part in self.parts.items() if not usable[part].all()
            )
            limit = "finite numbers" if self.type.dtype.kind == "f" else "numbers of at most 2^53"
            raise SessionError(f"output '{self._names[port]}' is {value}, expected {limit}")
