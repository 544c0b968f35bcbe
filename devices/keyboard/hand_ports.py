"""The ports of a virtual hand, led by keys, by a gamepad or from a page: those of one stylus or head."""

from __future__ import annotations

from typing import Literal, NamedTuple

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
    pose, twist = (
        Port(
            name=port,
            causality="output",
            type=type_,
            frame=frame,
            max_age_ns=max_age_ns,
            clock="wall",
            description=text,
        )
        for port, type_, text in (
            ("pose", PoseStamped.ros_type, _FRAMES[stands_for]),
            ("twist", TwistStamped.ros_type, "of the same, along the axes of the base frame"),
        )
    )
    buttons = Port(
        name="buttons",
        causality="output",
        type=Joy.ros_type,
        variability="event",
        frame=frame,
        clock="wall",
        description="each press and release: 0 the dead-man, 1 the jaw",
    )
    gripper = Port(
        name="gripper",
        causality="output",
        type=Float64Message.ros_type,
        clock="wall",
        description="0 closed, 1 open",
    )
    return HandPorts(pose, twist, buttons, gripper)
