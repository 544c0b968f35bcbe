"""Contact spheres of an instrument, fixed on links; each is the motion side of a contact with tissue."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np

from schemas.vectors import Vector

__all__ = ["FINGER_HALF_WIDTH", "JAW_ROOT", "ContactSphere", "on_jaw"]

FINGER_HALF_WIDTH = 0.0024
"""Half width of a finger of a jaw (m): 4.8 mm is the bound of the jaws in unina-icaros/dvrk-vrep, and of
tool_gripper1_link.STL in WPI-AIM/dvrk_env.
"""

JAW_ROOT = 0.0030
"""Distance from the wrist yaw axis (m) at which a finger is free of the hub of the opposite finger
(`engines.mujoco.looks.fingers`).
"""


@dataclass(frozen=True)
class ContactSphere:
    """A sphere."""

    name: str
    """Name, unique in the instrument."""
    link: str
    """Body under the sphere."""
    position: tuple[float, float, float]
    """Position of the centre in the frame of the body, m."""
    radius: float
    """m."""


def on_jaw(length: float, ahead: Vector) -> tuple[ContactSphere, ...]:
    """Return the spheres of two fingers: the left finger from root to end, then the right finger.

    The spheres are as wide as the finger and touch the plane of the pad from behind: in a jaw at 0 opposite
    spheres touch, and the gap between the spheres is the gap between the pads. The last sphere ends where the
    finger ends; their number leaves no gap between neighbours, two at least.

    Args:
        length: from the wrist yaw axis to the end of the fingers, m.
        ahead: direction to the tip in the frame of the wrist yaw link, shape (3,), perpendicular to its z
        axis.
    """
    radius = FINGER_HALF_WIDTH
    count = max(2, ceil((length - JAW_ROOT) / (2.0 * radius)))
    opening = np.cross((0.0, 0.0, 1.0), ahead)  # of the left finger, which turns about z
    spheres: list[ContactSphere] = []
    # the right one's frame is turned about x
    for link, turn in (("jaw_left", np.eye(3)), ("jaw_right", np.diag([1.0, -1.0, -1.0]))):
        side = turn[2, 2] * opening
        for i, way in enumerate(np.linspace(JAW_ROOT + radius, length - radius, count).tolist(), 1):
            x, y, z = (turn @ (way * ahead + radius * side)).tolist()
            spheres.append(ContactSphere(f"{link}_{i}", link, (x, y, z), radius))
    return tuple(spheres)
