"""Start values: declared by an FMU for inputs, or given in a scenario for parameters, inputs and states."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from engines.fmu.variables import number_type
from schemas.quantity import to_si

if TYPE_CHECKING:
    from fmpy.model_description import ModelVariable

__all__ = ["Start", "declared_start", "given_start", "settable", "size_of", "unit_of"]


@dataclass(frozen=True)
class Start:
    """A start value in the form for the FMU."""

    name: str
    reference: int
    access: str
    """The set function without prefix: `Real`, `Float64`, `String`, ..."""
    structural: bool
    """Whether the variable is a structural parameter (FMI 3), set in configuration mode."""
    value: NDArray[Any] | bytes
    """Numbers in the C type of the set function, shape (size,), or UTF-8 text."""


def settable(row: ModelVariable) -> bool:
    """Return whether a start value can be given.

    FMI 2.0.5 section 4.2.4, FMI 3.0.2 section 2.3.2: state Instantiated.
    """
    return row.variability != "constant" and (
        row.causality in {"input", "parameter", "structuralParameter"} or row.initial in {"exact", "approx"}
    )


def unit_of(row: ModelVariable) -> str:
    """Return the unit of a variable in the FMU's spelling, from the variable or its declared type."""
    return row.unit or (row.declaredType.unit if row.declaredType else None) or ""


def size_of(row: ModelVariable, start: Mapping[str, Any]) -> int:
    """Return the number of elements of a variable.

    Structural parameters among the start values change the size of FMI 3 arrays.
    """
    return math.prod(
        int(start.get(d.variable.name, d.variable.start) if d.variable else d.start) for d in row.dimensions
    )


def declared_start(row: ModelVariable, size: int) -> tuple[float, ...] | None:
    """Return the FMU's declared start value, `size` numbers; None: no declared value of this size."""
    numbers = [float({"true": "1", "false": "0"}.get(word, word)) for word in (row.start or "").split()]
    if len(numbers) == 1:
        numbers *= size
    return tuple(numbers) if len(numbers) == size and all(map(math.isfinite, numbers)) else None


def given_start(row: ModelVariable, given: Any, major: int, size: int) -> Start:
    """Return the start value `given`: a number, a text with a unit, a list of these, or true or false.

    For a String a text. Numbers are in the variable's unit. Raises ValueError for a value unfit for the
    variable.
    """
    structural = row.causality == "structuralParameter"
    if row.type == "String":
        if not isinstance(given, str):
            raise ValueError(f"'{row.name}' takes a text, not {given!r}")
        return Start(row.name, row.valueReference, "String", structural, given.encode())
    number = number_type(major, row.type)
    if number is None:
        raise ValueError(f"'{row.name}' is a {row.type}, which takes no start value here")
    numbers = [_number(row, item) for item in (given if isinstance(given, list | tuple) else [given])]  # pyright: ignore[reportUnknownVariableType]
    if len(numbers) not in {1, size}:
        raise ValueError(f"'{row.name}' takes {size} numbers, not {len(numbers)}")
    values = np.array(numbers * size if len(numbers) == 1 else numbers)
    return Start(
        row.name, row.valueReference, number.access, structural, number.from_float64(values, row.name)
    )


def _number(row: ModelVariable, item: Any) -> float:
    boolean = row.type == "Boolean"
    fits = (
        item in (False, True)
        if boolean
        else isinstance(item, int | float | str) and not isinstance(item, bool)
    )
    if not fits:
        raise ValueError(f"'{row.name}' takes {'true or false' if boolean else 'numbers'}, not {item!r}")
    number = to_si(item, unit_of(row)) if isinstance(item, str) else float(item)
    if isinstance(item, int) and item != number:
        raise ValueError(f"'{row.name}' cannot take {item}: it is no exact double")
    return number
