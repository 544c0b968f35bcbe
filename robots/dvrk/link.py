"""A moving link of an arm, with joint and pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from schemas.vectors import Vector

__all__ = ["Follow", "Link", "Spring"]


@dataclass(frozen=True)
class Follow:
    """Tie of a passive joint: position = `ratio` * position of `joint`."""

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
    """A link, and the joint to the parent, along or about the link's z axis."""

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
