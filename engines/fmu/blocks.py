"""Variables of an FMI type, set or got in a single call through prepared buffers."""

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
"""Highest FMI status of a running simulation (fmi2Status, fmi3Status: ok 0, warning 1, discard 2, error 3,
fatal 4).
"""

Access = Callable[[str, Sequence[int], NDArray[Any]], Callable[[], int]]
"""Maps a function's name such as `GetReal`, value references and a buffer to the prepared call, returning the
FMI status.
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

    `counted`: the function takes the number of values as well (FMI 3).
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
    """Yield groups of variables for a common call.

    The variables of a group have the same type and clocks, and all change at events only, or all at any time.
    """
    groups: dict[tuple[str, bool, tuple[int, ...]], list[Variable]] = {}
    for variable in variables:
        groups.setdefault((variable.type.name, variable.discrete, variable.clocks), []).append(variable)
    yield from groups.values()


class Block:
    """Some variables of a type, all inputs or all outputs."""

    def __init__(self, verb: str, variables: Sequence[Variable], access: Access) -> None:
        """Prepare the calls on the variables; `verb` is `Set` or `Get`."""
        self.type = variables[0].type
        self.discrete = variables[0].discrete
        self.clocks = variables[0].clocks
        size = sum(variable.size for variable in variables)
        self.raw = np.zeros(size, self.type.dtype)
        """The values in their C type, shape (size,)."""
        self.values: Vector = self.raw if self.type.dtype == np.float64 else np.zeros(size)
        """The values as doubles, shape (size,)."""
        self.always_usable = self.type.dtype.kind != "f" and self.type.dtype.itemsize < self.values.itemsize
        """Whether any value is a number of ports."""
        self._taken = b""
        self.is_changed = True
        """Whether values have changed since the last call; True for floats."""
        self._zeros = np.zeros(size)
        ends = np.cumsum([variable.size for variable in variables]).tolist()
        self.parts = {
            variable.port: slice(end - variable.size, end)
            for variable, end in zip(variables, ends, strict=True)
        }
        self._names = {variable.port: variable.name for variable in variables}
        self.function = function = verb + self.type.access
        """Name of the FMI function without prefix."""
        self.references = [variable.reference for variable in variables]
        self.call = access(function, self.references, self.raw)
        """Set or get all variables."""
        self._single = {
            v.name: access(function, [v.reference], self.raw[self.parts[v.port]]) for v in variables
        }

    @property
    def names(self) -> str:
        """The FMU's names of the variables, as text."""
        return ", ".join(self._names.values())

    def differing(self, before: NDArray[Any]) -> list[str]:
        """Return the FMU's names of the variables whose bytes differ from `before`, of the shape of `raw`."""
        return [
            self._names[port]
            for port, part in self.parts.items()
            if self.raw[part].tobytes() != before[part].tobytes()
        ]

    def refused(self) -> str:
        """Return the name of the first variable refused by the FMU.

        Called after the FMU has discarded a call on all variables.
        """
        return next((name for name, call in self._single.items() if call() > WARNING), self.names)

    def store(self, inputs: Inputs, tau: float) -> None:
        """Store the inputs at `tau` seconds after the start of the step.

        Inputs with changes at events only are read at the start of the step.
        """
        for port, part in self.parts.items():
            self.values[part] = inputs[port] if self.discrete else inputs.at(port, tau)
        if self.raw is self.values:
            return
        # converting costs more than comparing
        taken = self.values.tobytes()
        self.is_changed = taken != self._taken
        if self.is_changed:
            try:
                self.raw[:] = self.type.from_float64(self.values, self.names)
            except ValueError as error:
                raise SessionError(f"input {error}") from error
            self._taken = taken

    def forget(self) -> None:
        """Take all values as changed: the FMU has another state."""
        self._taken = b""

    def publish(self) -> bool:
        """Convert the outputs written by the FMU from their C type to doubles.

        Returns False for an output beyond the numbers of ports.
        """
        if self.raw is not self.values:
            np.copyto(self.values, self.raw)
        if self.always_usable:
            return True
        if self.type.dtype.kind == "f" and self.values.dot(self._zeros) == 0.0:
            return True  # a sum of zeros, unless one is infinite or NaN: a third of the cost of the rest
        return 0 not in self._usable().tobytes()  # a third of the cost of all()

    def unusable(self) -> SessionError:
        """Return the error for an output beyond the numbers of ports."""
        usable = self._usable()
        port, value = next(
            (port, self.values[part]) for port, part in self.parts.items() if not usable[part].all()
        )
        limit = "finite numbers" if self.type.dtype.kind == "f" else "numbers of at most 2^53"
        return SessionError(f"output '{self._names[port]}' is {value}, expected {limit}")

    def _usable(self) -> NDArray[np.bool_]:
        if self.type.dtype.kind == "f":
            return np.isfinite(self.values)
        return np.abs(self.values) <= LARGEST_EXACT
