"""One moving link of an arm: its joint, and how it stands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from schemas.vectors import Vector

__all__ = ["Follow", "Link", "Spring"]


@dataclass(frozen=True)
class Follow:
    """Tie of a passive joint: its position is `ratio` times that of `joint`."""

    joint: str
    ratio: float


@dataclass(frozen=True)
class Spring:
    """Spring and damper in a joint."""

    stiffness: float
    """N m/rad."""
    rest: float
    """Position without load, rad."""
    damping: float
    """N m s/rad."""


@dataclass(frozen=True)
class Link:
    """One link, and the joint along or about its z axis that joins it to its parent."""

    name: str
    parent: str
    kind: Literal["revolute", "prismatic"]
    pose: Vector
    """Pose in the arm's base frame with every joint at 0, shape (4, 4)."""
    lower: float
    upper: float
    follow: Follow | None = None
    spring: Spring | None = None
    reading: str = ""
    """Group of joint states with this link: `<arm>/<end effector>/<reading>/measured_js`; empty: none, as the
    motor says where it is.
    """
