"""Peg boards and their triangular rings: numbers with sources. SI units.

The frame of a board is in the middle of the top: x to the surgeon's right, y away from the surgeon, z up. The
frame of a ring is in the middle, z along the axis, y to a corner of the triangle.

Sources: SRC26 = surgical-robotics-ai/surgical_robotics_challenge, branch icra2026-challenge (commit 26bb2f6),
ADF/Phantoms/Pegboards/pegboard_symmetric_with_wall.yaml and the collision mesh of its block; SURROL =
med-air/SurRoL (commit a903fa6), assets/peg_board, assets/block and tasks/peg_transfer.py; FLS = the
Fundamentals of Laparoscopic Surgery as measured by Hwang et al., Superhuman Surgical Peg Transfer (2020).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import sqrt
from types import MappingProxyType

import numpy as np

from schemas.vectors import Vector

__all__ = ["BOARDS", "Board", "Ring", "Wall"]


@dataclass(frozen=True)
class Wall:
    """An upright slab on a board, an obstacle for rings."""

    centre: tuple[float, float]
    """Centre of the slab's foot in the board's frame, m."""
    size: tuple[float, float, float]
    """Along x, y and z of the board, m."""


@dataclass(frozen=True)
class Ring:
    """A tube with the outline of an equilateral triangle: a block with a hole."""

    inradius: float
    """Distance from the axis to the inner faces, m: the radius of the widest possible post."""
    thickness: float
    """Thickness of the three walls, m."""
    height: float
    """Height along the axis, m."""
    mass: float
    """kg."""
    friction: float
    """Coefficient of Coulomb friction."""

    @property
    def side(self) -> float:
        """Length of an outer side of the triangle, corner to corner, m."""
        return 2.0 * sqrt(3.0) * (self.inradius + self.thickness)


@dataclass(frozen=True)
class Board:
    """A board with posts, among them start posts and target posts."""

    size: tuple[float, float, float]
    """Along x, y and z, m."""
    posts: Vector
    """Where the posts stand, m in the board's frame, shape (n, 2)."""
    post_radius: float
    """m."""
    post_height: float
    """Over the board's top, m."""
    starts: tuple[int, ...]
    """Indices of the start posts, with one ring each."""
    targets: tuple[int, ...]
    """Indices of the target posts; any target post is right for any ring."""
    ring: Ring
    wall: Wall | None = None


_RUBBER = 1.2e3
"""kg/m^3, of the walls of a ring where the source's mass is impossible: natural rubber with filler."""


def _ring(inradius: float, thickness: float, height: float, friction: float) -> Ring:
    """Return a ring of rubber with the mass of its walls."""
    outer, inner = inradius + thickness, inradius
    area = 3.0 * sqrt(3.0) * (outer**2 - inner**2)
    return Ring(inradius, thickness, height, _RUBBER * area * height, friction)


def _posts(*rows: tuple[float, float]) -> Vector:
    posts = np.array(rows) * 1e-3
    posts.setflags(write=False)
    return posts


_ICRA = Board(
    size=(0.200, 0.100, 0.015),
    posts=_posts(*((x, y) for x in (-80, -60, -40, 40, 60, 80) for y in (-30, 0, 30))),
    post_radius=1.8e-3,
    post_height=0.020,
    starts=(3, 4, 5),
    targets=(9, 10, 11, 12, 13, 14, 15, 16, 17),
    ring=_ring(inradius=4.1e-3, thickness=0.8e-3, height=15.2e-3, friction=0.5),
    wall=Wall(centre=(-0.1e-3, -10.0e-3), size=(0.004, 0.080, 0.100)),
)
"""SRC26: 18 posts at a pitch of 20 mm in x and 30 mm in y, 40 mm to 80 mm from a wall 100 mm high. The camera
of SRC26 looks along -y of the world from y = 0.354 m, so the axes of the board are turned by 180 degrees
against that world. Rules: three rings start on any posts of the left side (here: the middle column), and any
post of the right side is a target. The ring's outer outline is 16.9 mm wide and 14.7 mm deep. The ring's mass
in SRC26, 0.1 kg, would mean walls of 170 g/cm^3; our rings are of rubber. The restitution of 0.1 is left out:
contacts are critically damped (docs/decisions/0053).
"""

_SURROL_POSTS = _posts(
    *((x, y) for y in (30, 10, -10) for x in (43, 13)),
    (-27, 33),
    (-27, -13),
    (-7.1, 21.5),
    (-7.1, -1.5),
    (-46.9, 21.5),
    (-46.9, -1.5),
)

_SURROL = Board(
    size=(0.154, 0.103, 0.022),
    posts=_SURROL_POSTS,
    post_radius=1.0e-3,
    post_height=0.026,
    starts=(6, 7, 10, 11),
    targets=(0, 1, 2, 3, 4, 5),
    ring=_ring(inradius=4.1e-3, thickness=0.8e-3, height=14.5e-3, friction=1.0),
)
"""SURROL: 12 pegs of radius 1.5 mm (collision shapes: 1.0 mm), 26 mm over a board with x to the surgeon and y
to the right in SURROL. Four rings start on four of the six pegs of the left side, drawn anew each time; we
take the pegs at the edges. The ring, 17 mm wide and 14.7 mm deep, has 10 g and 1 kg m^2 in SURROL; ours is of
rubber.
"""

_FLS = Board(
    size=(0.154, 0.103, 0.022),
    posts=_SURROL_POSTS,
    post_radius=1.125e-3,
    post_height=0.026,
    starts=(6, 7, 8, 9, 10, 11),
    targets=(0, 1, 2, 3, 4, 5),
    ring=_ring(inradius=4.5e-3, thickness=0.8e-3, height=15.0e-3, friction=1.0),
)
"""FLS: six rings with openings of 4.5 mm radius, pegs 2.25 mm wide. Our sources do not state the positions of
the twelve pegs and the heights of rings and pegs: taken from the board of SURROL, an imitation of FLS.
"""

BOARDS: Mapping[str, Board] = MappingProxyType({"icra2026": _ICRA, "surrol": _SURROL, "fls": _FLS})
"""The boards by name."""
