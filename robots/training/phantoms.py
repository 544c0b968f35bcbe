"""Phantoms for suturing: the pad, and entries and exits of the needle. Numbers with sources; SI.

The frame of a phantom is in the middle of the skin, x to the surgeon's right, y away from the surgeon, z out
of the tissue. The frame of a hole has z out of the tissue too, along the needle: against the needle's motion
at an entry, along the motion at an exit. Stitches go from right to left, for a right hand.

Sources: VREP = unina-icaros/dvrk-vrep (commit 88fe597), dVRK-suturing.ttt; SRC =
surgical-robotics-ai/surgical_robotics_challenge, ADF/Phantoms/*/phantom.yaml, bodies Entry1 to Exit4. The
surgeon's right is -x in SRC: the holes are rotated by half a turn. Our skins are level; holes of SRC are at
most 1.0 mm above or below.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import asin, cos, pi, sin
from types import MappingProxyType
from typing import Literal

import numpy as np

from schemas.vectors import Vector

__all__ = ["PHANTOMS", "Phantom", "PhantomName"]

PhantomName = Literal["branch-top", "src-3d-med", "src-straight", "src-simple"]
"""A key of `PHANTOMS`."""


@dataclass(frozen=True)
class Phantom:
    """A level pad of soft material on a base, with pairs of holes."""

    skin: tuple[float, float, float]
    """Size of the soft part along x, y and z, m."""
    base: float
    """Height of the hard base under the skin, m."""
    entries: Vector
    """Frames of the holes where the needle goes in, shape (n, 4, 4), in the phantom's frame."""
    exits: Vector
    """Frames of the needle's exits, shape (n, 4, 4)."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the holes, entries before exits."""
        n = len(self.entries)
        return (*(f"entry{i + 1}" for i in range(n)), *(f"exit{i + 1}" for i in range(n)))

    @property
    def holes(self) -> Vector:
        """Frames of all holes in the order of their names, shape (2 n, 4, 4)."""
        return np.concatenate([self.entries, self.exits])


_Row = tuple[float, float, float, float, float]
"""x, y, z in mm, and the rotation of the frame's z about y and then about z, rad."""


def _frames(rows: Sequence[_Row]) -> Vector:
    frames = np.zeros((len(rows), 4, 4))
    for frame, (x, y, z, pitch, yaw) in zip(frames, rows, strict=True):
        about_y = np.array([[cos(pitch), 0.0, sin(pitch)], [0.0, 1.0, 0.0], [-sin(pitch), 0.0, cos(pitch)]])
        about_z = np.array([[cos(yaw), -sin(yaw), 0.0], [sin(yaw), cos(yaw), 0.0], [0.0, 0.0, 1.0]])
        frame[:3, :3], frame[:3, 3], frame[3, 3] = about_z @ about_y, (x * 1e-3, y * 1e-3, z * 1e-3), 1.0
    return frames


def _src_phantom(
    skin: tuple[float, float, float], base: float, entries: Sequence[_Row], exits: Sequence[_Row]
) -> Phantom:
    """Return a phantom from frames in a world with the surgeon's right at -x, centred on the frames."""
    holes = _frames([*entries, *exits])
    holes[:, :3, 3] -= holes[:, :3, 3].mean(axis=0)
    turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    holes = turn @ holes
    holes.setflags(write=False)
    return Phantom(skin, base, holes[: len(entries)], holes[len(entries) :])


_3D_MED = _src_phantom(
    (0.075, 0.075, 0.012),
    0.010,
    (
        (20.971, 274.851, 744.430, -0.94571, -0.48371),
        (16.329, 263.065, 744.159, -0.94571, -0.27574),
        (17.054, 247.020, 743.166, -0.94571, 0.18022),
        (21.342, 233.361, 743.186, -0.94571, 0.51737),
    ),
    (
        (32.815, 269.419, 743.211, 0.94571, -0.46606),
        (29.744, 258.868, 743.524, 0.94571, -0.01772),
        (30.188, 247.791, 743.015, 0.94571, 0.18002),
        (32.978, 236.962, 742.690, 0.94571, 0.26578),
    ),
)
"""SRC, 3D_MED. The outline in SRC is a mesh; the size of our pad is assumed, wide enough for all stitches."""

_STRAIGHT = _src_phantom(
    (0.075, 0.075, 0.012),
    0.010,
    (
        (17.957, 242.351, 744.992, -1.25096, -0.02878),
        (18.204, 229.468, 745.412, -1.25096, -0.00225),
        (18.280, 214.371, 745.571, -1.25096, -0.02009),
        (17.995, 200.588, 745.425, -1.25096, -0.03375),
    ),
    (
        (27.894, 242.258, 745.542, 1.22631, 0.02241),
        (28.017, 228.699, 745.370, 1.23566, -0.01332),
        (28.328, 214.680, 746.082, 1.22631, 0.08972),
        (28.844, 201.308, 746.233, 1.22631, 0.08223),
    ),
)
"""SRC, 3D_MED_STRAIGHT. Left out: a rotation of exits 2 and 3 about x by 3 and 4 degrees. The size of our pad
is assumed.
"""

_SIMPLE = _src_phantom(
    (0.0797, 0.173, 0.012),
    0.0273,
    (
        (26.96, 198.90, 718.13, -0.80535, 0.0),
        (26.38, 175.40, 718.13, -0.80535, 0.0),
        (27.36, 152.68, 718.13, -0.80535, 0.0),
        (26.31, 127.03, 718.13, -0.80535, 0.0),
    ),
    (
        (34.78, 198.90, 717.99, 0.80535, 0.0),
        (34.78, 175.40, 717.99, 0.80535, 0.0),
        (34.78, 152.68, 717.99, 0.80535, 0.0),
        (34.78, 127.03, 717.99, 0.80535, 0.0),
    ),
)
"""SRC, Simple: 79.7 x 173 x 39.3 mm; the upper 12 mm are soft here (assumed)."""

_BITE, _APART = 16.0, 12.0
"""Width and pitch of the stitches on the authors' pad, mm: 8 mm either side of the wound, 12 mm apart
(assumed).
"""
_UPRIGHT = pi / 2.0 - asin(_BITE / 2.0 / 11.44)
"""Angle between a needle of 11.44 mm and the normal at the entry of a bite of 16 mm, rad."""


def _branch_top() -> Phantom:
    ys = [_APART * (1.5 - i) for i in range(4)]
    entries = _frames([(_BITE / 2.0, y, 0.0, _UPRIGHT, 0.0) for y in ys])
    exits = _frames([(-_BITE / 2.0, y, 0.0, -_UPRIGHT, 0.0) for y in ys])
    entries.setflags(write=False)
    exits.setflags(write=False)
    return Phantom((0.160, 0.1195, 0.0237), 0.0316, entries, exits)


_BRANCH_TOP = _branch_top()
"""VREP: skin 160 x 119.5 x 23.7 mm on a base 31.6 mm high. The scene has no stitches; ours are assumed."""

PHANTOMS: Mapping[PhantomName, Phantom] = MappingProxyType(
    {"branch-top": _BRANCH_TOP, "src-3d-med": _3D_MED, "src-straight": _STRAIGHT, "src-simple": _SIMPLE}
)
"""The phantoms by name."""
