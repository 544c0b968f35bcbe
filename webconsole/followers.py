"""Controllers that follow a hand led from a page: whether they do, and why not."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import NamedTuple

from schemas.codec import decode
from schemas.ros import BoolMessage, StringMessage
from schemas.scenario import Scenario
from webconsole.led_hands import led_hands
from webconsole.source import Value

__all__ = ["Follower", "find_followers", "find_pedals"]

_FOLLOWING = "following"
_PEDALS = {"energy": "pedal", "suction": "pedal", "irrigation": "rinse"}
"""Buttons of a hand by the outputs of its follower."""


class Follower(NamedTuple):
    """A controller that is connected to the pose of a device."""

    participant: str

    @property
    def following(self) -> str:
        """The outlet that says whether the arm follows the hand."""
        return f"{self.participant}.{_FOLLOWING}"

    @property
    def warning(self) -> str:
        """The outlet that says why the arm holds."""
        return f"{self.participant}.warning"

    @property
    def outlets(self) -> tuple[str, str]:
        """Both outlets."""
        return self.following, self.warning

    def hindrance(self, values: Mapping[str, Value | None]) -> str | None:
        """Return why the arm does not follow; None if it follows, or nothing is known.

        `values`: the newest values of both outlets. Raises MessageError for an invalid value.
        """
        following, warning = values[self.following], values[self.warning]
        if following is None or decode(BoolMessage, following.payload).data:
            return None
        said = "" if warning is None else decode(StringMessage, warning.payload).data
        return said or f"'{self.participant}' does not follow"


def find_followers(scenario: Scenario, outlets: Collection[str]) -> dict[str, list[Follower]]:
    """Return the followers of each hand led from pages, with both outlets among `outlets`.

    Where a page's hand holds a master, the follower is the one of the master.
    """
    found: dict[str, list[Follower]] = {}
    for hand in led_hands(scenario):
        led = {connection.target.participant for connection in hand.connections(scenario)}
        heard = (one for one in scenario.connections if one.target.participant in led)
        followers = [
            *sorted(led),
            *(one.source.participant for one in heard if one.target.port == _FOLLOWING),
        ]
        found[hand.name] = [
            one for one in map(Follower, dict.fromkeys(followers)) if {*one.outlets} <= {*outlets}
        ]
    return found


def find_pedals(
    followers: Mapping[str, Collection[Follower]], outlets: Collection[str]
) -> dict[str, list[str]]:
    """Return the buttons, `pedal` or `rinse`, that do something at the instruments led by each device."""
    return {
        device: sorted(
            {
                button
                for output, button in _PEDALS.items()
                for one in found
                if f"{one.participant}.{output}" in outlets
            }
        )
        for device, found in followers.items()
    }
