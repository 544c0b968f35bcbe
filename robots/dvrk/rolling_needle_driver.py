"""The rolling needle driver: a large needle driver whose pads slide to roll the needle between them.

Published is a needle driver with one degree of freedom more, which turns the needle between its jaws
(Fontanelli et al., "A New Laparoscopic Tool With In-Hand Rolling Capabilities for Needle Reorientation", IEEE
Robotics and Automation Letters, 2018). Its measures we could not read: those here are ours, see
docs/decisions/0019. SI units, radians.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

from robots.serial_chain import Joint, jerk_limit

__all__ = ["NAME", "PADS", "ROLLER", "Roller", "roller"]

NAME = "ROLLING_NEEDLE_DRIVER"
"""Of the instrument."""

PADS = ("pad_left", "pad_right")
"""The links: each slides along its finger, the left one forwards while the right one goes back."""

ROLLER = "roller"
"""The joint: the angle by which a wire of `Roller.wire_radius` rolls about its own tangent, from the pads'
middle position on.
"""

_DISTANCE = 0.0077
"""From the wrist yaw axis to the middle of the pads, m: as far out as pads of this length and their way leave
room for on a jaw of 10.2 mm.
"""

_WIRE_RADIUS = 0.4e-3
"""m, of the needle in unina-icaros/dvrk-vrep (dVRK-suturing.ttt)."""
_RANGE = radians(90.0)
"""Either way from a needle whose arc goes out ahead of the jaw: to one across it, forehand or backhand."""
_VELOCITY, _ACCELERATION = radians(180.0), radians(720.0)
"""The range in a second; the acceleration is that of wrist and jaw (`robots.dvrk.instruments`)."""


@dataclass(frozen=True)
class Roller:
    """Two pads that roll a round wire in place: each moves by `wire_radius` times the angle."""

    joint: Joint
    wire_radius: float
    """m; a wire of another radius turns by as much more as it is thinner."""
    distance: float
    """From the wrist yaw axis to the middle of the pads, m."""
    size: tuple[float, float, float]
    """Of a pad, m: along the finger, along the wire, and its thickness.

    Narrow as a rail, since a curved wire that is rolled out of the plane of wide pads wedges them apart, by
    the height of its arc over their width, and slips. Thinner than the wire's radius, so that the fingers
    behind hold a wire ahead of the pads.
    """
    pulley: float
    """By which the motor shifts the pads, m: one disc more than a PSM turns."""


def roller(jaw_effort: float) -> Roller:
    """Return the roller of a jaw of this largest torque (N m).

    Its effort is what makes the pads slip, at a friction coefficient of 1, on a needle that the jaw grips
    with all its torque.
    """
    effort = 2.0 * _WIRE_RADIUS * jaw_effort / _DISTANCE
    joint = Joint(
        ROLLER,
        "revolute",
        0.0,
        0.0,
        0.0,
        0.0,
        -_RANGE,
        _RANGE,
        _VELOCITY,
        effort,
        _ACCELERATION,
        jerk_limit(_ACCELERATION),
    )
    return Roller(joint, _WIRE_RADIUS, _DISTANCE, (0.0036, 0.0006, 0.0003), 0.001)
