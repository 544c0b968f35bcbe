"""Variables of a bond in an FMU: found, and checked for type, size and unit."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from engines.fmu.bond_params import FmuBond
from engines.fmu.start import unit_of
from engines.fmu.variables import Variable
from schemas.errors import ScenarioError, did_you_mean
from schemas.ports import COORDINATE_UNITS, BondSide
from schemas.quantity import to_si

if TYPE_CHECKING:
    from fmpy.model_description import ModelVariable

__all__ = ["BondVariables", "Quantity", "find_bond", "is_multiple"]

_ROLES = ("position", "velocity", "force")
_MOST_DOF = 3


@dataclass(frozen=True)
class Quantity:
    """Position, velocity or force of a bond in the FMU."""

    variables: tuple[Variable, ...]
    factor: float
    """SI units in a unit of the FMU; below 0: the FMU counts the other way."""


@dataclass(frozen=True)
class BondVariables:
    """A bond of an FMU, with the FMU's variables."""

    side: BondSide
    """Declared side, with stated numbers."""
    position: Quantity
    velocity: Quantity
    force: Quantity

    @property
    def inputs(self) -> tuple[Variable, ...]:
        """The FMU's inputs among the variables."""
        if self.side.side == "motion":
            return self.force.variables
        return self.position.variables + self.velocity.variables


def find_bond(
    path: Path,
    name: str,
    params: FmuBond,
    rows: Sequence[ModelVariable],
    variables: Mapping[str, Sequence[Variable]],
    sign: float = 1.0,
) -> BondVariables:
    """Return the bond `name` of the FMU at `path`.

    Args:
        path: the FMU.
        name: name of the bond.
        params: the bond as stated.
        rows: variables of the FMU's description.
        variables: exchanged variables by causality, `input` and `output`.
        sign: of the FMU's force, 1 or -1.

    Raises:
        ScenarioError: A variable is missing, has another causality or type, or units and sizes do not fit.
    """
    where = ("bonds", name)
    assert params.side is not None  # stated, or by a terminal
    found: dict[str, tuple[Variable, ...]] = {}
    for role in _ROLES:
        causality = "input" if (role == "force") == (params.side == "motion") else "output"
        known = {variable.name: variable for variable in variables[causality]}
        names: tuple[str, ...] = getattr(params, role)
        for one in names:
            if one not in known:
                problem = f"'{path}' has no {causality} '{one}' for the {role} of bond '{name}'"
                raise ScenarioError(f"{problem}.{did_you_mean(one, known)}", path=(*where, role))
            if known[one].type.name not in ("Real", "Float64") or known[one].discrete:
                kind = "discrete" if known[one].discrete else known[one].type.name
                problem = (
                    f"'{one}' of '{path}' is {kind}, and a bond takes continuous doubles (Real, Float64)"
                )
                raise ScenarioError(problem, path=(*where, role))
        found[role] = tuple(known[one] for one in names)
    sizes = {role: sum(variable.size for variable in found[role]) for role in _ROLES}
    if len({*sizes.values()}) > 1 or not 1 <= (dof := sizes["position"]) <= _MOST_DOF:
        counts = ", ".join(f"{role} {size}" for role, size in sizes.items())
        problem = f"position, velocity and force need as many numbers, 1 to {_MOST_DOF}, but have {counts}"
        raise ScenarioError(problem, path=where)
    units = {row.name: unit_of(row) for row in rows}
    declared = {role: {units[variable.name] for variable in found[role]} for role in _ROLES}
    coordinate, factors = _coordinate(path, params, declared, where)
    side = BondSide(
        name=name,
        side=params.side,
        dof=dof,  # pyright: ignore[reportArgumentType]  # 1 to 3, checked above
        coordinate=coordinate,
        frame=params.frame,
        stiffness=params.stiffness,
        contact_stiffness=params.stiffness,
        damping=params.damping,
        effective_mass=params.effective_mass,
    )
    signs = {role: sign if role == "force" else 1.0 for role in _ROLES}
    return BondVariables(side, *(Quantity(found[role], signs[role] * factors[role]) for role in _ROLES))


def _coordinate(
    path: Path, params: FmuBond, declared: Mapping[str, set[str]], where: tuple[str, ...]
) -> tuple[Literal["length", "angle"], Mapping[str, float]]:
    """Return the kind of coordinate by the FMU's units, and the factor to SI units by role."""
    for coordinate, targets in COORDINATE_UNITS.items():
        if params.coordinate in (None, coordinate):
            targeted = dict(zip(_ROLES, targets, strict=True))
            factors = {role: {*_factors(declared[role], targeted[role])} for role in _ROLES}
            if all(len(one) == 1 and math.isfinite(sum(one)) for one in factors.values()):
                return coordinate, {role: one.pop() for role, one in factors.items()}  # pyright: ignore[reportReturnType]
    have = ", ".join(f"{role} in {' and '.join(map(repr, sorted(declared[role])))}" for role in _ROLES)
    allowed = " or ".join(
        f"{', '.join(targets)} ({coordinate})"
        for coordinate, targets in COORDINATE_UNITS.items()
        if params.coordinate in (None, coordinate)
    )
    raise ScenarioError(f"'{path}' states {have}; a bond needs {allowed}, or multiples", path=where)


def is_multiple(unit: str, target: str) -> bool:
    """Return whether a unit in FMI's spelling has the dimension of `target`."""
    return math.isfinite(next(_factors({unit}, target)))


def _factors(units: set[str], target: str) -> Iterator[float]:
    """Yield the size of each unit in unit `target`; NaN for a unit of another dimension."""
    for unit in units:
        try:
            yield to_si(f"1 {_as_product(unit)}", target) if unit else 1.0
        except ValueError:
            yield math.nan


def _as_product(unit: str) -> str:
    """Return a unit in FMI's spelling, such as `N.m` or `kg.m2`, in the spelling of scenarios."""
    return re.sub(r"(?<=[A-Za-z])(-?\d)", r"^\1", unit.replace(".", "*"))
