"""The instruments that a page may ask for, for the arms of the devices that it leads."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from hub.participant import Params
from robots.dvrk.instruments import instrument
from robots.dvrk.tool_type import tool_type
from schemas.scenario import Scenario

__all__ = ["OfferedInstruments", "offered_instruments"]

_KIND, _COMMAND = "browser", "set_tool_type"


class OfferedInstruments(NamedTuple):
    """What an arm may hold."""

    device: str
    """Device that leads the arm, and may ask for an exchange."""
    arm: str
    instruments: list[str]
    """Names in the dVRK's words; at the start the first is in the arm."""


def offered_instruments(scenario: Scenario, params: Callable[[str], Params]) -> list[OfferedInstruments]:
    """Return the instruments of each arm whose exchange is connected to a device led from pages.

    `params` returns the validated parameters of a participant.
    """
    led = {name for name, spec in scenario.participants.items() if spec.kind == _KIND}
    found: dict[tuple[str, str], OfferedInstruments] = {}  # a task that counts exchanges has the arms, too
    for connection in scenario.connections:
        source, target = connection.source, connection.target
        arm, _, command = target.port.partition("/")
        if source.participant not in led or source.port != _COMMAND or command != _COMMAND:
            continue
        arms: dict[str, dict[str, Any] | None]
        arms = params(target.participant).model_dump(include={"arms"}).get("arms") or {}
        if (held := arms.get(arm)) is None:
            continue
        names: list[str] = [held["instrument"], *held.get("spares", ())]
        if len(names) > 1:
            types = [tool_type(instrument(name)) for name in names]
            found[source.participant, arm] = OfferedInstruments(source.participant, arm, types)
    return [*found.values()]
