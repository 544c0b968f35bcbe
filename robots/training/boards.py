"""Peg boards and the triangular rings that are carried between posts: numbers with their sources. SI units.

The frame of a board is in the middle of its top: x to the surgeon's right, y away from the surgeon, z up. The
frame of a ring is in its middle, z along its axis, y to one corner of the triangle.

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
    """An upright slab on a board, which a ring is to be carried over."""

    centre: tuple[float, float]
    """Of its foot on the board, m in the board's frame."""
    size: tuple[float, float, float]
    """Along x, y and z of the board, m."""


@dataclass(frozen=True)
class Ring:
    """A tube with the outline of an equilateral triangle: a block with a hole."""

    inradius: float
    """From its axis to the inner faces, m: the radius of the widest post that fits."""
    thickness: float
    """Of its three walls, m."""
    height: float
    """Along its axis, m."""
    mass: float
    """kg."""
    friction: float
    """Coulomb's coefficient towards all that it touches."""

    @property
    def side(self) -> float:
        """Length of an outer side of the triangle, corner to corner, m."""
        return 2.0 * sqrt(3.0) * (self.inradius + self.thickness)


@dataclass(frozen=True)
class Board:
    """A board with posts, and which of them rings start on and belong on."""

    size: tuple[float, float, float]
    """Along x, y and z, m."""
    posts: Vector
    """Where the posts stand, m in the board's frame, shape (n, 2)."""
    post_radius: float
    """m."""
    post_height: float
    """Over the board's top, m."""
    starts: tuple[int, ...]
    """Indices of the posts that rings start on, one ring each."""
    targets: tuple[int, ...]
    """Indices of the posts that rings are carried to; any of them will do for any ring."""
    ring: Ring
    wall: Wall | None = None


_RUBBER = 1.2e3
"""kg/m^3, of the walls of a ring where the source's mass is impossible: natural rubber with filler."""


def _ring(inradius: float, thickness: float, height: float, friction: float) -> Ring:
    """Return a ring of rubber, whose mass is that of its walls."""
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
"""SRC26: 18 posts at a pitch of 20 mm in x and 30 mm in y, 40 mm to 80 mm from a wall 100 mm high. Its camera
looks along -y of its world from y = 0.354 m, so the axes of the board are turned by 180 degrees against that
world. Rules: three rings start on posts of the left side, any; we take the middle column. Any post of the
right side will do. The ring's outer outline is 16.9 mm wide and 14.7 mm deep. Its mass there, 0.1 kg, would
be a density of 170 g/cm^3 in those walls; ours are of rubber. Its restitution 0.1 is left out: contacts are
critically damped (docs/decisions/0053).
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
"""SURROL: 12 pegs of radius 1.5 mm, whose collision shapes have 1.0 mm, 26 mm over a board whose x points to
the surgeon there and y to the right. Four rings start on four of the six pegs of the left side, drawn anew
each time; we take those at its edges. The ring, 17 mm wide and 14.7 mm deep, has 10 g there and an inertia of
1 kg m^2; ours is of rubber.
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
"""FLS: six rings with openings of 4.5 mm radius, pegs 2.25 mm wide. Where the twelve pegs stand, and how high
ring and pegs are, none of our sources states: as on the board of SURROL, which imitates it.
"""

BOARDS: Mapping[str, Board] = MappingProxyType({"icra2026": _ICRA, "surrol": _SURROL, "fls": _FLS})
"""The boards by name."""
