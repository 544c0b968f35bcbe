"""Physical quantities in scenarios: `80 mm`, `10 kPa`, `1 ms` become SI floats.

Durations become integer nanoseconds. A bare number is taken in the SI unit of the field; a unit of another
dimension is an error.
"""

from __future__ import annotations

import math
import re
import sys
from functools import cache
from tokenize import TokenError
from typing import Annotated, Any

from pydantic import BeforeValidator, PlainSerializer, WithJsonSchema

from schemas.magnitudes import require_magnitude

__all__ = [
    "MAX_LENGTH",
    "Acceleration",
    "Angle",
    "Damping",
    "Density",
    "Duration",
    "Force",
    "Length",
    "Mass",
    "Perfusion",
    "Power",
    "Pressure",
    "Speed",
    "Stiffness",
    "Toughness",
    "Volume",
    "VolumeFlow",
    "same_unit",
    "to_si",
]


_FACTOR = r"(?:1|%|°?[^\W\d]\w*)(?:(?:\^|\*\*)-?\d)?"
_UNIT = re.compile(rf"\(*{_FACTOR}\)*(?:(?:\s*[*/]\s*|\s+)\(*{_FACTOR}\)*)*")
"""Units passed on to pint, a parser of more than units: `9**9**9` would keep pint busy for ever."""
MAX_LENGTH = 100
"""Most characters of a quantity and of a unit: pint recurses at each parenthesis, and tries every prefix and
suffix of an unknown name.
"""
_QUANTITY = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)", re.ASCII)


_FACTORS = {
    ("mm", "m"): 1e-3,
    ("cm", "m"): 1e-2,
    ("um", "m"): 1e-6,
    ("deg", "rad"): math.pi / 180.0,
    ("min", "s"): 60.0,
    ("ms", "s"): 1e-3,
    ("us", "s"): 1e-6,
    ("ns", "s"): 1e-9,
    ("g", "kg"): 1e-3,
    ("kPa", "Pa"): 1e3,
    ("mN", "N"): 1e-3,
    ("kN/m", "N/m"): 1e3,
    ("mm/s", "m/s"): 1e-3,
}
"""Factors of the most frequent units, as pint has them: a session with no other unit starts half a second
sooner.
"""


@cache
def _registry() -> Any:
    from pint import UnitRegistry  # 0.2 s to import and as long to build, so only where it is needed

    return UnitRegistry()  # pyright: ignore[reportUnknownVariableType]


def _convert_unit(number: float, unit: str, target: str) -> float:
    """Return `number` in unit `target`; raises ValueError if `unit` has another dimension."""
    if unit == target:
        return number
    if factor := _FACTORS.get((unit, target)):
        return number * factor
    from pint.errors import PintError

    if max(len(unit), len(target)) > MAX_LENGTH:
        raise ValueError(f"a unit of more than {MAX_LENGTH} characters is not allowed")
    if not _UNIT.fullmatch(unit) or not _UNIT.fullmatch(target):
        raise ValueError(f"'{unit}' is not a unit")
    try:
        return float(_registry().Quantity(number, unit).to(target).magnitude)
    except (PintError, AssertionError, TokenError, TypeError, ValueError, ArithmeticError) as error:
        raise ValueError(str(error) or f"'{unit}' is not a unit") from error


def to_si(value: Any, unit: str) -> float:
    """Return `value`, a number or a text such as `80 mm`, in the SI unit `unit`.

    Raises ValueError if `value` is no finite quantity of the dimension of `unit`.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"expected a quantity in {unit}, such as '1 {unit}'")
    if isinstance(value, str) and len(value) > MAX_LENGTH:
        raise ValueError(
            f"'{value[:20]}...' is not a quantity in {unit} (it has {len(value)} characters; at most"
            f" {MAX_LENGTH} are allowed)"
        )
    if isinstance(value, int) and abs(value) > sys.float_info.max:  # its digits may be too many to write
        raise ValueError(f"an integer of {value.bit_length()} bits is not a quantity in {unit} (too large)")
    try:
        match = _QUANTITY.fullmatch(value.strip()) if isinstance(value, str) else None
        if isinstance(value, str) and not match:
            raise ValueError("expected a number and a unit")
        number = float(match[1] if match else value)
        if match and match[2]:
            number = _convert_unit(number, match[2], unit)
    except (ValueError, OverflowError) as error:
        raise ValueError(f"'{value}' is not a quantity in {unit} ({error})") from error
    if not math.isfinite(number):
        raise ValueError(f"'{value}' is not a quantity in {unit} (it is not finite)")
    return number


@cache
def same_unit(one: str, other: str) -> bool:
    """Return whether two units are the same in dimension and size; an empty unit equals any."""
    if not one or not other or one == other:
        return True
    try:
        return math.isclose(_convert_unit(1.0, one, other), 1.0, rel_tol=1e-12)
    except ValueError:
        return False


def _quantity_type(unit: str, example: str) -> Any:
    schema = {
        "anyOf": [{"type": "number"}, {"type": "string"}],
        "description": f"a number in {unit}, or a text with its unit",
        "examples": [example],
        "unit": unit,
    }
    return BeforeValidator(lambda value: require_magnitude(to_si(value, unit), unit)), WithJsonSchema(schema)


def _to_nanoseconds(value: Any) -> int:
    nanoseconds = to_si(value, "s") * 1e9
    if abs(nanoseconds) >= 2**63:
        raise ValueError(f"'{value}' is longer than 64 bits of nanoseconds can represent, 292 years")
    whole = round(nanoseconds)
    if not math.isclose(whole, nanoseconds, rel_tol=4 * sys.float_info.epsilon, abs_tol=1e-3):
        raise ValueError(f"'{value}' is not a whole number of nanoseconds")
    return whole


Length = Annotated[float, *_quantity_type("m", "80 mm")]
Mass = Annotated[float, *_quantity_type("kg", "20 g")]
Power = Annotated[float, *_quantity_type("W", "30 W")]
Pressure = Annotated[float, *_quantity_type("Pa", "10 kPa")]
Density = Annotated[float, *_quantity_type("kg/m^3", "1000 kg/m^3")]
Toughness = Annotated[float, *_quantity_type("J/m^2", "160 J/m^2")]
Volume = Annotated[float, *_quantity_type("m^3", "50 ml")]
VolumeFlow = Annotated[float, *_quantity_type("m^3/s", "30 ml/s")]
Perfusion = Annotated[float, *_quantity_type("m^3/(s kg)", "860 ml/min/kg")]
Force = Annotated[float, *_quantity_type("N", "2 N")]
Stiffness = Annotated[float, *_quantity_type("N/m", "1000 N/m")]
Damping = Annotated[float, *_quantity_type("N*s/m", "5 N*s/m")]
Angle = Annotated[float, *_quantity_type("rad", "30 deg")]
Speed = Annotated[float, *_quantity_type("m/s", "50 mm/s")]
Acceleration = Annotated[float, *_quantity_type("m/s^2", "9.81 m/s^2")]
Duration = Annotated[
    int,
    BeforeValidator(_to_nanoseconds),
    PlainSerializer(lambda ns: f"{ns} ns", when_used="json"),
    WithJsonSchema(
        {
            "anyOf": [{"type": "number"}, {"type": "string"}],
            "description": "seconds, or a text with its unit",
            "examples": ["1 ms"],
            "unit": "s",
        }
    ),
]
"""Integer nanoseconds."""
