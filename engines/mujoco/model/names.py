"""Names in the model: bodies and joints `<arm>/<link>`, sites `<arm>/base` and `<arm>/tip`."""

from __future__ import annotations

__all__ = ["CONTACT", "first_sensor", "instrument_body", "probe_body", "sphere_site"]

CONTACT = "contact"
"""Name of an arm's bond at its contact spheres, and the second part of the names of their sites."""


def probe_body(arm: str) -> str:
    """Return the name of the body whose origin and centre of mass is the centre of a palpation probe."""
    return f"{arm}/wrist_yaw"


def instrument_body(arm: str) -> str:
    """Return the name of the body that carries the shaft of a PSM's instrument, and on it all the rest."""
    return f"{arm}/roll"


def sphere_site(arm: str, sphere: str) -> str:
    """Return the name of the site that is the centre of the contact sphere of this name."""
    return f"{arm}/{CONTACT}/{sphere}"


def first_sensor(arm: str) -> str:
    """Return the name of the first of the arm's sensors.

    They lie in this order: positions, velocities and efforts of the n joints; tip in the base frame (position
    3, quaternion w, x, y, z); tip in the world (the same, then linear and angular velocity); those of the end
    effector (`engines.mujoco.model.end_effector.add_sensors`), such as positions, velocities and efforts of
    the two fingers of a jaw, left before right; positions of all contact spheres in the world, then their
    velocities.
    """
    return f"{arm}/position/yaw"
