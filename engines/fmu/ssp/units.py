"""Units of SSP and FMI by their exponents of SI base units, and the conversion from one to another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from engines.fmu.ssp.transformations import Linear
from engines.fmu.ssp.xml_file import Node
from schemas.quantity import to_si

if TYPE_CHECKING:
    from fmpy.model_description import ModelDescription

__all__ = ["Unit", "conversion", "model_units", "read_units"]

_BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True)
class Unit:
    """A unit: `SI value = factor * value + offset`."""

    name: str
    exponents: tuple[int, ...] | None = None
    """Exponents of kg, m, s, A, K, mol, cd, rad; None: the name is all that is known."""
    factor: float = 1.0
    offset: float = 0.0

    def is_same(self, other: Unit) -> bool:
        """Return whether both are one unit, by definition, or by name where a definition lacks."""
        if self.exponents is None or other.exponents is None:
            return self.name == other.name
        return (self.exponents, self.factor, self.offset) == (other.exponents, other.factor, other.offset)


def read_units(parent: Node | None) -> dict[str, Unit]:
    """Return the units of an element `Units`, by name. Raises ScenarioError."""
    units: dict[str, Unit] = {}
    for node in parent.all("ssc:Unit") if parent else ():
        name, base = node.require("name"), node.find("ssc:BaseUnit")
        if base is None:
            units[name] = Unit(name)
            continue
        exponents = tuple(int(base.number(key, 0)) for key in _BASE)
        units[name] = Unit(name, exponents, base.number("factor", 1.0), base.number("offset", 0.0))
    return units


def model_units(model: ModelDescription) -> Mapping[str, Unit]:
    """Return the units that an FMU defines, by name."""
    units: dict[str, Unit] = {}
    for one in model.unitDefinitions:
        name, base = one.name, one.baseUnit
        units[name] = Unit(name)
        if base is not None:
            exponents = (base.kg, base.m, base.s, base.A, base.K, base.mol, base.cd, base.rad)
            units[name] = Unit(name, exponents, base.factor, base.offset)
    return units


def conversion(source: Unit, target: Unit) -> Linear:
    """Return the conversion of a value in `source` to `target`.

    Raises ValueError for units of different dimension, and for a unit without a definition.
    """
    if source.is_same(target):
        return Linear()
    if source.exponents is None or target.exponents is None:
        try:
            return Linear(to_si(f"1 {source.name}", target.name))
        except ValueError as error:
            raise ValueError(
                f"'{source.name}' is not converted to '{target.name}', as the files define only"
                f" {' and '.join(one.name for one in (source, target) if one.exponents) or 'neither'}: define"
                " both in Units"
            ) from error
    if source.exponents != target.exponents or not target.factor:
        raise ValueError(f"'{source.name}' and '{target.name}' are units of different dimension")
    return Linear(source.factor / target.factor, (source.offset - target.offset) / target.factor)
