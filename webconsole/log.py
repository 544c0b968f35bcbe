"""Lines of the page's log, made of messages about events."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Literal, NamedTuple

from schemas.codec import decode, message_type
from schemas.crtk import OperatingState
from schemas.ports import Port
from schemas.readable import readable
from schemas.ros import DiagnosticStatus, StringMessage
from schemas.trocar_msgs import ScoreCard, TaskEvent, TissueEvent, TissueGrasp
from webconsole.source import Outlet, Value

__all__ = ["Entries", "Entry", "Tally", "card_of", "is_logged"]

Level = Literal["info", "warn", "error"]

_SUMMED_S = 5.0
"""Time over which a tally is summed up, s: on a busy machine every step is late."""
_LOGGED = frozenset(
    one.ros_type for one in (TaskEvent, TissueEvent, TissueGrasp, DiagnosticStatus, OperatingState)
)
"""Types of the logged messages."""
_SAID: Mapping[str, Level] = {"status": "info", "error": "error"}
"""Levels of the logged texts of an arm (CRTK)."""
_LEVELS: tuple[Level, ...] = ("info", "warn", "error", "error")
"""Levels of a DiagnosticStatus: OK, WARN, ERROR, STALE (diagnostic_msgs/msg/DiagnosticStatus)."""


def is_logged(port: Port) -> bool:
    """Return whether messages of a port are lines of the log."""
    return port.type in _LOGGED or _level_said(port) is not None


def _level_said(port: Port) -> Level | None:
    """Return the level of texts about an arm, `<arm>/status` and `<arm>/error`; None for other ports."""
    arm, _, word = port.name.rpartition("/")
    return _SAID.get(word) if arm and port.type == StringMessage.ros_type else None


class Entry(NamedTuple):
    """A line of the log."""

    time_s: float
    """Simulated time."""
    level: Level
    source: str
    text: str

    def as_json(self) -> dict[str, Any]:
        """Return the line, ready for JSON."""
        return {"time": self.time_s, "level": self.level, "source": self.source, "text": self.text}


class Tally:
    """Sums up what a session counts, late steps or refused messages, so that it hides no other line."""

    def __init__(self) -> None:
        self._said, self._said_s = 0, -math.inf

    def more(self, total: int, now_s: float, *, last: bool = False) -> int:
        """Return how many more there are since the last line; 0 while no line is due."""
        more = total - self._said
        if more <= 0 or (now_s - self._said_s < _SUMMED_S and not last):
            return 0
        self._said, self._said_s = total, now_s
        return more


class Entries:
    """Makes lines of messages, in order of publication."""

    def __init__(self) -> None:
        self._states: dict[str, str] = {}
        """Last line of each periodically published state."""

    def lines_of(self, outlet: Outlet, value: Value) -> Iterator[Entry]:
        """Yield the new lines of a message; raises MessageError if the message is not valid."""
        for entry in _entries(outlet, value):
            if outlet.port.type == OperatingState.ros_type:
                if self._states.get(outlet.name) == entry.text:
                    continue
                self._states[outlet.name] = entry.text
            yield entry


def _entries(outlet: Outlet, value: Value) -> Iterator[Entry]:
    if not is_logged(outlet.port):
        return
    message, at = decode(message_type(outlet.port.type), value.payload), value.time_ns / 1e9
    if isinstance(message, TaskEvent):
        about = " ".join(filter(None, (message.object, message.arm, message.place)))
        amount = f", {message.value:.3g} {message.unit}" if message.unit else ""
        yield Entry(at, "info", outlet.participant, f"{message.event}: {about}{amount}")
    elif isinstance(message, TissueEvent):
        organ, by = outlet.port.name.partition("/")[0], f" by {message.instrument}" * bool(message.instrument)
        text = f"{organ} {message.kind}{by}, {readable(message.size, message.unit)}"
        yield Entry(at, "warn" if message.kind == "torn" else "info", outlet.participant, text)
    elif isinstance(message, TissueGrasp):
        torn = message.event in ("torn", "exchanged while holding")
        text = f"{message.body} {message.event}, pull {message.force_n:.2g} N"
        yield Entry(at, "warn" if torn else "info", outlet.name, text)
    elif isinstance(message, DiagnosticStatus):
        level = _LEVELS[min(int(message.level), len(_LEVELS) - 1)]
        yield Entry(at, level, outlet.participant, message.message)
    elif isinstance(message, StringMessage) and (level := _level_said(outlet.port)) is not None:
        yield Entry(at, level, outlet.name.rpartition("/")[0], message.data)
    elif isinstance(message, OperatingState):
        fault = message.state == "FAULT"
        text = f"{message.state}{', homed' if message.is_homed else ''}"
        yield Entry(at, "error" if fault else "info", outlet.name, text)


def card_of(value: Value) -> dict[str, Any]:
    """Return a score card, ready for JSON; raises MessageError if the card is not valid."""
    card = decode(ScoreCard, value.payload)
    return {
        "task": card.task,
        "goals": card.goals,
        "reached": card.reached,
        "metrics": [one.model_dump() for one in card.metrics],
        "rules": [{"rules": one.rules, "values": [v.model_dump() for v in one.values]} for one in card.rules],
    }
