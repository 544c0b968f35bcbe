"""Clocks of FMI 3.0: the description of one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from engines.fmu.variables import port_name
from hub.participant import event_in, event_out
from schemas.ports import Port
from schemas.ros import EmptyMessage

if TYPE_CHECKING:
    from fmpy.model_description import ModelDescription, ModelVariable

__all__ = ["Clock", "clock_of", "complete_clocks"]

_TRIGGERED = "triggered"
_TIMES = ("intervalDecimal", "shiftDecimal", "resolution", "intervalCounter", "shiftCounter")


@dataclass(frozen=True)
class Clock:
    """An input or output clock of an FMU."""

    name: str
    port: str
    reference: int
    is_input: bool
    kind: str
    """FMI's intervalVariability: constant, fixed, tunable, changing, countdown or triggered."""
    interval: float | None
    """Time between two ticks, s; None: the FMU says so as it runs."""
    shift: float
    """Time of the first tick, s."""
    about: str = ""

    @property
    def is_timed(self) -> bool:
        """Whether the importer lets the clock tick, at times by FMI; others tick on events."""
        return self.is_input and self.kind != _TRIGGERED

    @property
    def ports(self) -> tuple[Port, ...]:
        """Port of a triggered clock: a message for each tick. Clocks of known times have none."""
        if self.is_timed:
            return ()
        text = f"ticks of FMU clock '{self.name}'" + (f": {self.about}" if self.about else "")
        declare = event_in if self.is_input else event_out
        return (declare(self.port, EmptyMessage, text),)


def complete_clocks(model: ModelDescription, text: bytes) -> None:
    """Read the times of clocks from modelDescription.xml: FMPy 0.3 leaves them out."""
    rows = {row.name: row for row in model.modelVariables if row.type == "Clock"}
    for element in ElementTree.fromstring(text).iterfind("ModelVariables/Clock"):
        if (row := rows.get(element.get("name", ""))) is not None:
            for attribute in _TIMES:
                setattr(row, attribute, element.get(attribute))


def clock_of(row: ModelVariable) -> Clock | None:
    """Return the clock of a variable; None for other variables, and for clocks that stay inside."""
    if row.type != "Clock" or row.causality not in {"input", "output"}:
        return None
    interval, shift = row.intervalDecimal, float(row.shiftDecimal or 0.0)
    if interval is None and row.resolution and row.intervalCounter:
        interval = int(row.intervalCounter) / int(row.resolution)
        shift = int(row.shiftCounter or 0) / int(row.resolution)
    return Clock(
        row.name,
        port_name(row.name),
        row.valueReference,
        row.causality == "input",
        row.intervalVariability or _TRIGGERED,
        None if interval is None else float(interval),
        shift,
        " ".join((row.description or "").split()),
    )
