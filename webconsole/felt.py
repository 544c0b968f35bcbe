"""Felt force of a hand that leads from a page: the force on the instrument under the hand's lead."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection

from schemas.scenario import Scenario

__all__ = ["felt_wrenches"]

_WRENCH = "/tip_wrench"
_KIND = "browser"


def felt_wrenches(scenario: Scenario, numbers: Collection[str]) -> dict[str, tuple[str, ...]]:
    """Return the outlets of the wrenches (N, N m) on the moved instruments, by device led from pages.

    `numbers`: the numeric outlets. Connections are followed from the device to the robot; where the ports
    name an arm, only the instrument of this arm is meant.
    """
    wrenches = {name for name in numbers if name.endswith(_WRENCH)}
    arms = {name.partition(".")[2].removesuffix(_WRENCH) for name in wrenches}
    led = [name for name, spec in scenario.participants.items() if spec.kind == _KIND]
    return {device: found for device in led if (found := _find_wrenches(scenario, device, wrenches, arms))}


def _find_wrenches(
    scenario: Scenario, device: str, wrenches: Collection[str], arms: Collection[str]
) -> tuple[str, ...]:
    waiting, found = deque([(device, "")]), set[str]()
    seen = {*waiting}
    while waiting:
        participant, arm = waiting.popleft()
        wrench = f"{participant}.{arm}{_WRENCH}"
        if wrench in wrenches:
            found.add(wrench)  # what the robot publishes goes back to who moves it
            continue
        for connection in scenario.connections:
            named = connection.target.port.partition("/")[0]
            of = named if named in arms else arm
            if connection.source.participant != participant or (arm and of != arm):
                continue
            reached = connection.target.participant, of
            if reached not in seen:
                seen.add(reached)
                waiting.append(reached)
    return tuple(sorted(found))
