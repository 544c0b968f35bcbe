"""Physical quantities in scenarios: `80 mm`, `10 kPa`, `1 ms` become SI floats (durations: integer nanoseconds).

A bare number is taken in the SI unit of the field; another dimension is refused.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BeforeValidator, PlainSerializer, WithJsonSchema

if TYPE_CHECKING:
    from pint import UnitRegistry

__all__ = ["Acceleration", "Angle", "Damping", "Density", "Duration", "Force", "Length", "Mass", "Pressure", "Speed", "Stiffness", "same_unit", "to_si"]


@cache
def _registry() -> UnitRegistry[float]:
    from pint import UnitRegistry  # 0.2 s to build, so only where a quantity is read

    return UnitRegistry()


def to_si(value: Any, unit: str) -> float:
    """Return `value`, a number or a text such as `80 mm`, in the SI unit `unit`. Raises ValueError if it is no such quantity."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"expected a quantity in {unit}, such as '1 {unit}'")
    if not isinstance(value, str):
        return float(value)
    from pint.errors import PintError

    try:
        quantity = _registry().Quantity(value)
        return float(quantity.magnitude) if quantity.unitless else float(quantity.to(unit).magnitude)
    except (PintError, AssertionError, TypeError, ValueError, ZeroDivisionError) as error:
        raise ValueError(f"'{value}' is no quantity in {unit} ({error})") from error


@cache
def same_unit(one: str, other: str) -> bool:
    """Say whether two units are the same in dimension and size; an empty unit is the same as any."""
    if not one or not other or one == other:
        return True
    from pint.errors import PintError

    try:
        return float(_registry().Quantity(1.0, one).to(other).magnitude) == 1.0
    except (PintError, AssertionError, TypeError, ValueError):
        return False


def _quantity(unit: str, example: str) -> Any:
    schema = {"anyOf": [{"type": "number"}, {"type": "string"}], "description": f"a number in {unit}, or a text with its unit", "examples": [example]}
    return BeforeValidator(lambda value: to_si(value, unit)), WithJsonSchema(schema)


def _nanoseconds(value: Any) -> int:
    seconds = to_si(value, "s")
    nanoseconds = round(seconds * 1e9)
    if abs(nanoseconds - seconds * 1e9) > 1e-3:
        raise ValueError(f"'{value}' is no whole number of nanoseconds")
    return nanoseconds


Length = Annotated[float, *_quantity("m", "80 mm")]
Mass = Annotated[float, *_quantity("kg", "20 g")]
Pressure = Annotated[float, *_quantity("Pa", "10 kPa")]
Density = Annotated[float, *_quantity("kg/m^3", "1000 kg/m^3")]
Force = Annotated[float, *_quantity("N", "2 N")]
Stiffness = Annotated[float, *_quantity("N/m", "1000 N/m")]
Damping = Annotated[float, *_quantity("N*s/m", "5 N*s/m")]
Angle = Annotated[float, *_quantity("rad", "30 deg")]
Speed = Annotated[float, *_quantity("m/s", "50 mm/s")]
Acceleration = Annotated[float, *_quantity("m/s^2", "9.81 m/s^2")]
Duration = Annotated[
    int,
    BeforeValidator(_nanoseconds),
    PlainSerializer(lambda ns: f"{ns} ns", when_used="json"),
    WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "string"}], "description": "seconds, or a text with its unit", "examples": ["1 ms"]}),
]
"""Integer nanoseconds."""
