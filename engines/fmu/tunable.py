"""Tunable parameters of an FMU: ports for people to change while the session runs.

A change enters with a grant, as with the parameters of other participants (docs/decisions/0119). The value in
effect is the FMU's own state, so after a return to a saved state it is read from the FMU.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from engines.fmu.blocks import Block
from engines.fmu.start import declared_start, given_start, unit_of
from engines.fmu.variables import Variable, number_type, port_name
from hub.participant import Inputs, Tunables, tunable_in
from schemas.errors import ScenarioError, did_you_mean
from schemas.ports import Port

if TYPE_CHECKING:
    from fmpy.model_description import ModelVariable

    from engines.fmu.instance import Instance

__all__ = ["TunableParameters", "tunable_parameters"]

Limits = Sequence[Any] | None
"""Least and greatest value as given in a scenario; None: those of the FMU."""


def tunable_parameters(
    path: Path,
    rows: Iterable[ModelVariable],
    major: int,
    given: Mapping[str, Limits],
    starts: Mapping[str, float],
) -> Iterator[tuple[Variable, Port]]:
    """Yield variable and port of each parameter that may change; `starts`: given start values.

    Raises ScenarioError for a variable that FMI does not let change, and for limits that are none.
    """
    tunable = {row.name: row for row in rows if (row.causality, row.variability) == ("parameter", "tunable")}
    for name, limits in given.items():
        try:
            if name not in tunable:
                raise ValueError(f"there is no tunable parameter '{name}'.{did_you_mean(name, tunable)}")
            yield _tunable(tunable[name], major, limits, starts)
        except ValueError as error:
            raise ScenarioError(f"'{path}': {error}", path=("tunable", name)) from error


def _tunable(
    row: ModelVariable, major: int, limits: Limits, starts: Mapping[str, float]
) -> tuple[Variable, Port]:
    number = number_type(major, row.type)
    if number is None or row.dimensions:
        raise ValueError(f"'{row.name}' is no single number; only such parameters may change")
    least, most = _limits(row, major, limits)
    declared = declared_start(row, 1)
    start = starts.get(row.name, declared[0] if declared else least)
    if not least <= start <= most:
        raise ValueError(f"'{row.name}' starts at {start:g}, outside {least:g} to {most:g}")
    variable = Variable(row.name, port_name(row.name), row.valueReference, number, 1, discrete=True)
    about = " ".join((row.description or "").split()) or f"FMU variable '{row.name}' ({row.type})"
    return variable, tunable_in(variable.port, start, (least, most), about, unit_of(row))


def _limits(row: ModelVariable, major: int, given: Limits) -> tuple[float, float]:
    if given is None:
        given = [row.min, row.max]
        if None in given:
            raise ValueError(f"the FMU states no limits of '{row.name}': write them, '{row.name}: [0, 1]'")
        given = [float(end) for end in given]
    ends = np.asarray(given_start(row, list(given), major, 2).value, np.float64).tolist()
    if ends[0] >= ends[1]:
        raise ValueError(f"the limits of '{row.name}' are {ends[0]:g} and {ends[1]:g}: least, then greatest")
    return ends[0], ends[1]


class TunableParameters:
    """The tunable parameters of an instance."""

    def __init__(self, instance: Instance, variables: Sequence[Variable], ports: Sequence[Port]) -> None:
        """Find the values in effect."""
        self._instance = instance
        self._ports = [port for port in ports if port.limits is not None]
        self._set = {one.port: instance.block("Set", [one]) for one in variables}
        self._get = {one.port: instance.block("Get", [one]) for one in variables}
        self.read()

    def read(self) -> None:
        """Take the values in effect from the FMU."""
        for block in self._get.values():
            self._instance.transfer(block)
            block.publish()
        self._tunables = Tunables(
            port.model_copy(update={"start": (float(self._get[port.name].values[0]),)})
            for port in self._ports
        )

    def begin(self, inputs: Inputs) -> None:
        """Set the changed parameters, for the step that begins."""
        changed: list[Block] = []
        for name, value in self._tunables.changes(inputs):
            changed.append(self._set[name])
            changed[-1].store(Inputs({name: np.array([value])}), 0.0)
        if changed:
            self._instance.tune(changed)
