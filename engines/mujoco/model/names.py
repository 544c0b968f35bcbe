"""What the parts of an arm are called in the model: bodies and joints `<arm>/<link>`, sites `<arm>/base` and `<arm>/tip`."""

from __future__ import annotations

__all__ = ["FINGERS", "finger", "first_sensor", "probe_body"]

FINGERS = ("jaw_left", "jaw_right")
"""Both turn about the wrist yaw axis by half the jaw's angle: the left one towards the tip's +y, the right one towards -y."""


def probe_body(arm: str) -> str:
    """Return the name of the body whose origin and centre of mass is the centre of a palpation probe."""
    return f"{arm}/wrist_yaw"


def finger(arm: str, side: str) -> str:
    """Return the name of the body, joint and actuator of one of `FINGERS`."""
    return f"{arm}/{side}"


def first_sensor(arm: str) -> str:
    """Return the name of the first of the arm's sensors.

    They lie in this order: positions, velocities and efforts of the n joints; tip in the base frame (position 3, quaternion w, x,
    y, z); tip in the world (the same, then linear and angular velocity); and, where there is a jaw, positions, velocities and
    efforts of the two fingers, left before right.
    """
    return f"{arm}/position/yaw"
