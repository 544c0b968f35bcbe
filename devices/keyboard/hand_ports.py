"""The ports of a virtual hand, led by keys, by a gamepad or from a page, as of a single stylus or head."""

from __future__ import annotations

from typing import Literal, NamedTuple

from hub.participant import event_out, signal_out
from schemas.ports import Port
from schemas.ros import Float64Message, Joy, PoseStamped, TwistStamped

__all__ = ["HandPorts", "StandsFor", "hand_ports"]

StandsFor = Literal["stylus", "head"]

_FRAMES: dict[StandsFor, str] = {
    "stylus": "of the tip; z out of the point, x to the right when it points away from the user",
    "head": "of the head: x ahead, y to the left, z up",
}


class HandPorts(NamedTuple):
    """Beside these a virtual hand has `diagnostics`."""

    pose: Port
    twist: Port
    buttons: Port
    gripper: Port


def hand_ports(participant: str, stands_for: StandsFor, max_age_ns: int) -> HandPorts:
    """Return the ports of a virtual hand, in the frame `<participant>_base` (x ahead, y left, z up)."""
    frame = f"{participant}_base"
    pose, axes = _FRAMES[stands_for], "of the same, along the axes of the base frame"
    presses = "each press and release: 0 the dead-man, 1 the jaw, 2 power or suction, 3 saline"
    return HandPorts(
        signal_out("pose", PoseStamped, pose, frame=frame, max_age_ns=max_age_ns, clock="wall"),
        signal_out("twist", TwistStamped, axes, frame=frame, max_age_ns=max_age_ns, clock="wall"),
        event_out("buttons", Joy, presses, frame=frame, clock="wall"),
        signal_out("gripper", Float64Message, "0 closed, 1 open", clock="wall"),
    )
