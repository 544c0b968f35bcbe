"""Terminals of FMI 3.0 as bonds: the members that are force, position and velocity, side and sign.

A flow that is `inflow` is positive into the FMU, `outflow` out of it (FMI 3.0.2, section 2.4.9.2); the force
of a bond acts on the motion side. Position and velocity are told apart by their units.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from engines.fmu.archive import TERMINALS, opened_archive
from engines.fmu.bond_params import FmuBond
from engines.fmu.bond_variables import is_multiple
from engines.fmu.start import unit_of
from schemas.errors import ScenarioError, did_you_mean
from schemas.ports import COORDINATE_UNITS

if TYPE_CHECKING:
    from fmpy.model_description import ModelVariable

__all__ = ["Terminal", "matched_bond", "read_terminals"]

_FLOWS = {"inflow": 1.0, "outflow": -1.0}
"""Sign of a force into the FMU by `variableKind`."""


@dataclass(frozen=True)
class Terminal:
    """A terminal of an FMU."""

    members: tuple[tuple[str, str], ...]
    """Variable and `variableKind` of each member."""
    has_streams: bool = False


def read_terminals(path: Path) -> dict[str, Terminal]:
    """Return the terminals of the FMU at `path` by name, those inside another as `outer.inner`.

    Raises ScenarioError for a file that is no XML.
    """
    with opened_archive(path) as (_, archive):
        if TERMINALS not in archive.namelist():
            return {}
        text = archive.read(TERMINALS)
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ScenarioError(f"'{path}': {TERMINALS} is no XML: {error}") from error
    return dict(_terminals(root.iterfind("Terminals/Terminal"), ""))


def _terminals(elements: Iterator[ElementTree.Element], outer: str) -> Iterator[tuple[str, Terminal]]:
    for element in elements:
        name = outer + element.get("name", "")
        members = element.iterfind("TerminalMemberVariable")
        yield (
            name,
            Terminal(
                tuple((one.get("variableName", ""), one.get("variableKind", "")) for one in members),
                has_streams=element.find("TerminalStreamMemberVariable") is not None,
            ),
        )
        yield from _terminals(element.iterfind("Terminal"), f"{name}.")


def matched_bond(
    path: Path, name: str, bond: FmuBond, terminals: Mapping[str, Terminal], rows: Sequence[ModelVariable]
) -> tuple[FmuBond, float]:
    """Return the bond `name` with the variables of its terminal, and the sign of the force.

    A bond without a terminal is returned as it is. Raises ScenarioError where a terminal is no bond.
    """
    if not bond.terminal:
        return bond, 1.0
    try:
        return _match(bond, terminals, {row.name: row for row in rows})
    except ValueError as error:
        problem = f"'{path}': {error}. State side, force, position and velocity instead."
        raise ScenarioError(problem, path=("bonds", name, "terminal")) from error


def _match(
    bond: FmuBond, terminals: Mapping[str, Terminal], rows: Mapping[str, ModelVariable]
) -> tuple[FmuBond, float]:
    name = bond.terminal
    if name not in terminals:
        raise ValueError(
            f"the FMU has no terminal '{name}'{did_you_mean(name, terminals).removesuffix('.')}"
            if terminals
            else f"the FMU has no terminals ({TERMINALS})"
        )
    terminal = terminals[name]
    if terminal.has_streams:
        raise ValueError(f"terminal '{name}' has stream variables, which a bond has not")
    found: dict[str, list[str]] = {"force": [], "position": [], "velocity": []}
    kinds: dict[str, float] = {}
    for variable, kind in terminal.members:
        if variable not in rows:
            raise ValueError(f"terminal '{name}' has '{variable}', which is no variable of the FMU")
        if kind in _FLOWS:
            kinds[kind] = _FLOWS[kind]
        found[_role(name, rows[variable], kind)].append(variable)
    if missing := [role for role, members in found.items() if not members]:
        raise ValueError(f"terminal '{name}' has no {' and no '.join(missing)}")
    if len(kinds) > 1:
        raise ValueError(f"terminal '{name}' mixes inflow and outflow, and a bond has one sign")
    (into,) = kinds.values()
    causalities = {rows[one].causality for one in found["force"]}
    if causalities not in ({"input"}, {"output"}):
        raise ValueError(f"the force of terminal '{name}' is {' and '.join(map(str, sorted(causalities)))}")
    side = "motion" if causalities == {"input"} else "force"
    bond.check_side(side)
    update = {"side": side} | {role: tuple(members) for role, members in found.items()}
    return bond.model_copy(update=update), into if side == "motion" else -into


def _role(terminal: str, row: ModelVariable, kind: str) -> str:
    """Return the role of a member: by `variableKind` a force, by unit a position or a velocity."""
    if kind in _FLOWS:
        return "force"
    unit = unit_of(row)
    for role, at in (("position", 0), ("velocity", 1)):
        if unit and any(is_multiple(unit, units[at]) for units in COORDINATE_UNITS.values()):
            return role
    raise ValueError(
        f"'{row.name}' of terminal '{terminal}' ({kind}) in '{unit}' is neither a flow, nor a position"
        " (m, rad) or a velocity (m/s, rad/s)"
    )
