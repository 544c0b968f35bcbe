"""The spheres with which an instrument touches tissue.

They are fixed on its links; each is the motion side of a contact point.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np

from schemas.vectors import Vector

__all__ = ["FINGER_HALF_WIDTH", "ContactSphere", "on_jaw"]

FINGER_HALF_WIDTH = 0.0024
"""Half width of a finger of a jaw (m): 4.8 mm is the bound of the jaws in unina-icaros/dvrk-vrep, and of
tool_gripper1_link.STL in WPI-AIM/dvrk_env.
"""

_JAW_ROOT = 0.0030
"""Distance from the wrist yaw axis (m) at which a finger is free of the other one's hub
(`engines.mujoco.looks.fingers`).
"""


@dataclass(frozen=True)
class ContactSphere:
    """One sphere."""

    name: str
    """Unique in its instrument."""
    link: str
    """The body that carries it."""
    position: tuple[float, float, float]
    """Position of its centre in the frame of that body, m."""
    radius: float
    """m."""


def on_jaw(length: float, ahead: Vector) -> tuple[ContactSphere, ...]:
    """Return the spheres of two fingers: of the left one from the root to the end, then of the right one.

    They are as wide as the finger and touch the plane of its pad from behind, so that those of a jaw at 0
    touch each other and the gap between them is that of the pads. The last one ends where the finger ends;
    there are as many as it takes to leave no gap, two at least.

    Args:
        length: from the wrist yaw axis to the end of the fingers, m.
        ahead: direction to the tip in the frame of the wrist yaw link, shape (3,), perpendicular to its z
        axis.
    """
    radius = FINGER_HALF_WIDTH
    count = max(2, ceil((length - _JAW_ROOT) / (2.0 * radius)))
    opening = np.cross((0.0, 0.0, 1.0), ahead)  # of the left finger, which turns about z
    spheres: list[ContactSphere] = []
    # the right one's frame is turned about x
    for link, turn in (("jaw_left", np.eye(3)), ("jaw_right", np.diag([1.0, -1.0, -1.0]))):
        side = turn[2, 2] * opening
        for i, way in enumerate(np.linspace(_JAW_ROOT + radius, length - radius, count).tolist(), 1):
            x, y, z = (turn @ (way * ahead + radius * side)).tolist()
            spheres.append(ContactSphere(f"{link}_{i}", link, (x, y, z), radius))
    return tuple(spheres)
