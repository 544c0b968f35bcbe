"""A variation of a sweep: a parameter of a scenario, and the values to try."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from ruamel.yaml import YAML, YAMLError

from schemas.errors import ScenarioError

__all__ = ["MAX_VALUES", "Variation", "number_and_unit", "parse"]

MAX_VALUES = 10_000
"""Largest number of values of a parameter: a range with more is a slip of the keyboard."""

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_QUANTITY = re.compile(rf"({_NUMBER})\s*([^\d\s.:][^.:]*)?")
_RANGE = re.compile(
    rf"({_NUMBER})\s*([^\d\s.:][^.:]*?)?\s*\.\.\s*({_NUMBER})\s*([^\d\s.:][^.:]*?)?\s*:\s*(\d+)"
)


@dataclass(frozen=True)
class Variation:
    """A parameter and the values to try."""

    path: str
    """Path of the parameter, as for `--set` of `trocar run`."""
    values: tuple[Any, ...]
    """Values as in a scenario: numbers, texts such as `5 kPa`, lists."""

    @property
    def unit(self) -> str | None:
        """The common unit of all values, empty for plain numbers; None if a value is no number."""
        found = [number_and_unit(value) for value in self.values]
        units = {each[1] for each in found if each is not None}
        return units.pop() if None not in found and len(units) == 1 else None


def number_and_unit(value: Any) -> tuple[float, str] | None:
    """Return a number and its unit; None for anything but a number."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    if not isinstance(value, str):
        return float(value), ""
    found = _QUANTITY.fullmatch(value.strip())
    return (float(found[1]), (found[2] or "").strip()) if found else None


def parse(text: str) -> Variation:
    """Read `PATH=FIRST..LAST:COUNT`, evenly spaced, or `PATH=VALUE,VALUE,...`.

        parse("tissue.organs.block.young_modulus=5 kPa..50 kPa:10")
        parse("participants.robot.kind=[mujoco, fmu]")

    Raises ScenarioError if the text is neither.
    """
    path, equals, values = text.partition("=")
    if not equals or not path.strip() or not values.strip():
        raise ScenarioError(
            f"--vary {text}: expected PATH=FIRST..LAST:COUNT, such as 'duration=1 s..2 s:3', or"
            " PATH=VALUE,VALUE"
        )
    if found := _RANGE.fullmatch(values.strip()):
        return Variation(path.strip(), _space_values(text, *found.groups()))
    if ".." in values:
        raise ScenarioError(
            f"--vary {text}: '{values}' is not a range: expected FIRST..LAST:COUNT, such as 5 kPa..50 kPa:10"
        )
    return Variation(path.strip(), _list_values(text, values))


def _space_values(
    text: str, first: str, unit: str | None, last: str, last_unit: str | None, count: str
) -> tuple[Any, ...]:
    if unit and unit != last_unit:
        raise ScenarioError(
            f"--vary {text}: from '{unit}' to '{last_unit or 'no unit'}'; both ends need the same unit"
        )
    if not 1 <= len(count) <= len(str(MAX_VALUES)) or not 2 <= int(count) <= MAX_VALUES:
        raise ScenarioError(f"--vary {text}: {count} values, allowed are 2 to {MAX_VALUES}")
    # 12 digits: the values that a person reads off a range, not those of its rounding
    numbers = [float(f"{value:.12g}") for value in np.linspace(float(first), float(last), int(count))]
    if last_unit:
        return tuple(f"{number:.12g} {last_unit}" for number in numbers)
    whole = all(number.is_integer() for number in numbers) and not set(".eE") & set(first + last)
    return tuple(int(number) if whole else number for number in numbers)


def _list_values(text: str, values: str) -> tuple[Any, ...]:
    yaml: Any = YAML(typ="safe", pure=True)
    try:
        found: Any = yaml.load(f"[{values}]")
    except YAMLError as error:
        raise ScenarioError(f"--vary {text}: '{values}' is not a list of YAML values") from error
    if len(found) == 1 and isinstance(found[0], list):
        found = found[0]
    listed: tuple[Any, ...] = tuple(found)
    if not 1 <= len(listed) <= MAX_VALUES:
        raise ScenarioError(f"--vary {text}: {len(listed)} values, allowed are 1 to {MAX_VALUES}")
    return listed
