"""Force felt by a hand that leads from a page: on the instrument led, or on the hand that holds a master."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable

from schemas.scenario import Connection, Scenario
from webconsole.led_hands import led_hands

__all__ = ["felt_wrenches"]

_WRENCHES = ("/tip_wrench", "/hand_cf")
"""Ends of the names: on an instrument, and on a hand that holds a master."""


def felt_wrenches(scenario: Scenario, numbers: Collection[str]) -> dict[str, tuple[str, ...]]:
    """Return the outlets of the wrenches (N, N m) on what each hand led from pages moves, by the hand.

    `numbers`: the numeric outlets. Connections are followed from the hand to the robot; where the ports name
    an arm, only this arm is meant.
    """
    wrenches = {name for name in numbers if name.endswith(_WRENCHES)}
    arms = {name.partition(".")[2].rpartition("/")[0] for name in wrenches}
    found = {
        hand.name: _find_wrenches(scenario, hand.connections(scenario), wrenches, arms)
        for hand in led_hands(scenario)
    }
    return {name: felt for name, felt in found.items() if felt}


def _find_wrenches(
    scenario: Scenario, first: Iterable[Connection], wrenches: Collection[str], arms: Collection[str]
) -> tuple[str, ...]:
    waiting, found = deque((connection, "") for connection in first), set[str]()
    seen = set[tuple[str, str]]()
    while waiting:
        connection, before = waiting.popleft()
        named = connection.target.port.partition("/")[0]
        arm = named if named in arms else before
        participant = connection.target.participant
        if (before and arm != before) or (participant, arm) in seen:
            continue
        seen.add((participant, arm))
        felt = {f"{participant}.{arm}{end}" for end in _WRENCHES} & {*wrenches}
        found |= felt
        if not felt:  # what the robot publishes goes back to who moves it
            waiting += ((one, arm) for one in scenario.connections if one.source.participant == participant)
    return tuple(sorted(found))
