"""The hands of a scenario that pages lead: a `browser` is one, a `browser-pair` two."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from devices.browser.pair import BrowserPair
from schemas.scenario import Connection, Scenario

__all__ = ["LedHand", "led_hands"]


class LedHand(NamedTuple):
    """A hand by the name by which pages lead it, and its ports."""

    name: str
    participant: str
    prefix: str
    """Beginning of the names of the ports."""

    def connections(self, scenario: Scenario) -> Iterator[Connection]:
        """Yield the connections of the hand's outputs."""
        for connection in scenario.connections:
            source = connection.source
            if source.participant == self.participant and source.port.startswith(self.prefix):
                yield connection


def led_hands(scenario: Scenario) -> list[LedHand]:
    """Return the hands that pages lead."""
    hands: list[LedHand] = []
    for name, spec in scenario.participants.items():
        if spec.kind == "browser":
            hands.append(LedHand(name, name, ""))
        elif spec.kind == "browser-pair":
            hands += [LedHand(hand, name, f"{hand.rpartition('/')[2]}/") for hand in BrowserPair.led(name)]
    return hands
