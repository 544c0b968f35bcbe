"""Names in the model: bodies and joints `<arm>/<link>`, sites `<arm>/base` and `<arm>/tip`."""

from __future__ import annotations

__all__ = ["CONTACT", "PARKED_M", "SEAT", "first_sensor", "instrument_body", "probe_body", "sphere_site"]

SEAT = "seat"
"""Slide of an instrument on an arm with spares, along the insertion: 0 in the arm, `-PARKED_M` out of use."""
PARKED_M = 1000.0
"""Distance, m, at which no camera sees an instrument and nothing touches one."""

CONTACT = "contact"
"""Name of the bond at contact spheres, and second part of the names of the spheres' sites."""


def probe_body(arm: str) -> str:
    """Return the name of a palpation probe's body; origin and centre of mass are the sphere's centre."""
    return f"{arm}/wrist_yaw"


def instrument_body(arm: str) -> str:
    """Return the name of the body of the shaft of a PSM's instrument, the root of the whole instrument."""
    return f"{arm}/roll"


def sphere_site(arm: str, sphere: str) -> str:
    """Return the name of the site at the centre of a contact sphere."""
    return f"{arm}/{CONTACT}/{sphere}"


def first_sensor(arm: str, joint: str = "yaw") -> str:
    """Return the name of the arm's first sensor, the position of its first joint.

    The order of sensors: positions, velocities and efforts of the n joints; tip in the base frame (position
    3, quaternion w, x, y, z); tip in the world (the same, then linear and angular velocity); end effector
    (`engines.mujoco.model.end_effector.add_sensors`), such as positions, velocities and efforts of the two
    fingers of a jaw, left before right; positions of all contact spheres in the world, then their velocities.
    """
    return f"{arm}/position/{joint}"
