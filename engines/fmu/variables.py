"""FMU variables as numbers: port names, FMI types, and exact conversion from float64."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schemas.vectors import Vector

__all__ = ["LARGEST_EXACT", "NumberType", "Variable", "number_type", "port_name"]

LARGEST_EXACT = 2**53
"""Whole numbers up to this size are float64 numbers (IEEE 754 binary64 has 53 significant bits)."""

_ILLEGAL = re.compile(r"[^A-Za-z0-9_]|_(?=x[0-9A-F]{2,}_)")
_BAD_START = re.compile(r"[^A-Za-z]|x(?=[0-9A-F]{2,}_)")


@dataclass(frozen=True)
class NumberType:
    """An FMI type of numbers or truth values."""

    name: str
    """`Real`, `Float64`, `Boolean`, `Enumeration`, ..."""
    access: str
    """Get and set functions without prefix: `Real` for `fmi2GetReal` and `fmi2SetReal`."""
    dtype: np.dtype[Any]
    """The C type of get and set functions."""

    def from_float64(self, values: Vector, variable: str) -> NDArray[Any]:
        """Return `values` in the C type.

        A boolean is 0 or 1, an integer a whole number in range and of at most 2^53. Raises ValueError, naming
        the variable, for a value without an exact representation.
        """
        low, high = self._integer_bounds()
        fits = (values >= low) & (values <= high)
        if self.dtype.kind != "f":
            fits &= values == np.rint(values)
        if not fits.all():
            what = "numbers" if self.dtype.kind == "f" else "whole numbers"
            raise ValueError(
                f"'{variable}' takes {what} from {low:.17g} to {high:.17g}, not {values[~fits][0]:.17g}"
            )
        return values.astype(self.dtype)

    def _integer_bounds(self) -> tuple[float, float]:
        if self.name == "Boolean":
            return 0.0, 1.0
        if self.dtype.kind == "f":
            return float(np.finfo(self.dtype).min), float(np.finfo(self.dtype).max)
        info = np.iinfo(self.dtype)
        return float(max(info.min, -LARGEST_EXACT)), float(min(info.max, LARGEST_EXACT))


@dataclass(frozen=True)
class Variable:
    """An input or output of an FMU, as a port."""

    name: str
    port: str
    reference: int
    """FMI's value reference."""
    type: NumberType
    size: int
    discrete: bool
    """Whether the variable changes at events only."""
    clocks: tuple[int, ...] = ()
    """Value references of the clocks at whose ticks the variable exists; empty: it exists always."""


_FMI2 = {
    "Real": NumberType("Real", "Real", np.dtype(np.float64)),
    "Integer": NumberType("Integer", "Integer", np.dtype(np.int32)),
    "Enumeration": NumberType("Enumeration", "Integer", np.dtype(np.int32)),
    "Boolean": NumberType("Boolean", "Boolean", np.dtype(np.int32)),
}
_FMI3 = {
    **{
        f"Float{bits}": NumberType(f"Float{bits}", f"Float{bits}", np.dtype(f"float{bits}"))
        for bits in (32, 64)
    },
    **{
        f"Int{bits}": NumberType(f"Int{bits}", f"Int{bits}", np.dtype(f"int{bits}"))
        for bits in (8, 16, 32, 64)
    },
    **{
        f"UInt{bits}": NumberType(f"UInt{bits}", f"UInt{bits}", np.dtype(f"uint{bits}"))
        for bits in (8, 16, 32, 64)
    },
    "Enumeration": NumberType("Enumeration", "Int64", np.dtype(np.int64)),
    "Boolean": NumberType("Boolean", "Boolean", np.dtype(np.bool_)),
}


def number_type(major: int, fmi_type: str) -> NumberType | None:
    """Return an FMI type by name; None: a type without numbers.

    Names as in FMI 2.0 (fmi2TypesPlatform.h) or 3.0 (fmi3PlatformTypes.h).
    """
    return (_FMI2 if major == 2 else _FMI3).get(fmi_type)


def port_name(variable: str) -> str:
    """Return the port name of an FMU variable. Port names are unique: the conversion is reversible.

    A dot becomes `/`; any other character forbidden in port names becomes `_xHH_`, with the code point in
    hexadecimal, or `xHH_` at the start of a part: `body.r[1]` is `body/r_x5B_1_x5D_`, `arm._q` is
    `arm/x5F_q`.
    """
    parts = variable.split(".")
    return "/".join(map(_escape_part, parts if all(parts) else [variable]))


def _escape_part(part: str) -> str:
    head = f"x{ord(part[0]):02X}_" if _BAD_START.match(part) else part[0]
    return head + _ILLEGAL.sub(lambda match: f"_x{ord(match[0]):02X}_", part[1:])
