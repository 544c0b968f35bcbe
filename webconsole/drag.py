"""The arms whose tips a page may drag: led by a device of pages through a teleoperation of poses."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from hub.participant import Params
from schemas.scenario import Scenario

__all__ = ["DraggedTip", "dragged_tips"]

_KIND, _TELEOPERATION = "browser", "teleoperation"
_LEVEL = (0.0, 0.0, 0.0, 1.0)


class DraggedTip(NamedTuple):
    """A device, the arm it leads, and the frame that the device's axes are along."""

    device: str
    arm: str
    view: str
    """`base` of the arm, or `camera`: the picture."""
    turns: bool
    """Whether the tip turns with the hand."""


def dragged_tips(
    scenario: Scenario, params: Callable[[str], Params]
) -> tuple[tuple[DraggedTip, ...], tuple[str, ...]]:
    """Return the arms whose tips can be dragged, and why others cannot.

    `params` returns the validated parameters of a participant.
    """
    found, reasons = list[DraggedTip](), list[str]()
    led = [name for name, spec in scenario.participants.items() if spec.kind == _KIND]
    if not led:
        reasons.append("no device of this session is led from a page (kind browser, host: remote)")
    for device in led:
        teleoperation = _teleoperation(scenario, device)
        if teleoperation is None:
            reasons.append(f"'{device}' leads no teleoperation")
            continue
        given = params(teleoperation).model_dump(
            include={"arm", "law", "view", "engage", "registration", "orientation"}
        )
        if given["law"] != "pose" or given["engage"] != "held" or given["view"] == "display":
            reasons.append(f"'{teleoperation}' needs law: pose, engage: held, and view: base or camera")
        elif tuple(given["registration"]) != _LEVEL:
            reasons.append(f"'{teleoperation}' turns the hand's frame (registration)")
        else:
            turns = given["orientation"] == "follow"
            found.append(DraggedTip(device, given["arm"], given["view"], turns))
    return tuple(found), tuple(reasons)


def _teleoperation(scenario: Scenario, device: str) -> str | None:
    """Return the teleoperation whose master the device is."""
    for connection in scenario.connections:
        target = connection.target
        if connection.source.participant == device and target.port == "master":
            spec = scenario.participants.get(target.participant)
            if spec is not None and spec.kind == _TELEOPERATION:
                return target.participant
    return None
