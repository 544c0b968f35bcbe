"""The identified dynamics of the master tool manipulators.

The masses of `robots.dvrk.arm_bodies` are fitted to them and tested against them.

Source: WPIID = WPI-AIM/dvrk_dynamics_identification (commit 7697d3a), main_mtm.ipynb for the model and
data/mtm/dynamic_params/params.json for the numbers; Wang, Gondokaryono, Munawar, Fischer, "A convex
optimization-based dynamic model identification package for the da Vinci Research Kit", RA-L 2019. Single
masses and tensors lie at the bounds of that optimization and tell nothing each by itself; gravity and the
inertia matrix of the whole arm are identified. The shoulder carries a parallelogram: a crank and a bar drive
the forearm. SI units, radians; q as the dVRK's joint positions.
"""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np

from schemas.vectors import Vector

__all__ = ["FRICTION", "gravity", "inertia_matrix"]

_G = 9.81
"""m/s^2, as in WPIID."""
_INSTANT = 1e-5
"""rad, of the central difference by a joint."""


class _Link(NamedTuple):
    """A link of WPIID's model: parent, modified DH row, angle as sum over q2, q3 and the link's own joint."""

    parent: int
    alpha: float
    a: float
    d: float
    offset: float
    turns: tuple[tuple[int, float], ...]
    """Joint and factor of each term of the angle."""
    mass: float
    centre: tuple[float, float, float]
    """Centre of mass from the link's origin, along the axes of the base with every joint at 0, m."""
    tensor: tuple[float, float, float, float, float, float]
    """About the centre, same axes: xx, xy, xz, yy, yz, zz, kg m^2."""


_LINKS = (
    _Link(
        -1, 0.0, 0.0, -0.2154, 0.0, ((0, 1.0),), 7.9205524, (0.0, 0.0, 0.1475298),
        (20.0328015, 0.0, 0.0, 20.0328015, 0.0, -8e-07),
    ),
    _Link(
        0, -pi / 2, 0.0, 0.0, pi / 2, ((1, 1.0),), 10.9839011, (-0.0037064, -0.0011631, 0.0282467),
        (0.0191505, -0.0029393, -0.0003536, 0.0006272, -0.0022588, 0.0192754),
    ),
    _Link(
        1, 0.0, 0.2794, 0.0, pi / 2, ((2, 1.0),), 0.8122158, (-0.1397595, -0.0300011, -0.030025),
        (0.0071813, -0.0006232, 0.0117288, 0.0261615, 0.0003851, 0.019021),
    ),
    _Link(
        0, -pi / 2, 0.0, 0.0, pi, ((1, 1.0), (2, 1.0)), 10.0000001, (0.0301125, -0.0033478, 0.0011687),
        (0.0026841, -0.0002349, 0.004443, 0.0098409, 0.0001459, 0.0071718),
    ),
    _Link(
        3, 0.0, 0.1, 0.0, -pi / 2, ((2, -1.0),), 0.9964826, (-0.0200044, 0.0199996, -0.0499997),
        (0.0191021, -0.0029318, -0.0003526, 0.0006262, -0.002253, 0.0192267),
    ),
    _Link(
        2, -pi / 2, 0.3645, 0.151, 0.0, ((3, 1.0),), 0.2077769, (0.0006989, -0.0673588, -0.1500229),
        (0.003407, -3.49e-05, 0.000484, 0.0032076, 0.0011393, -0.0002048),
    ),
    _Link(
        5, pi / 2, 0.0, 0.0, 0.0, ((4, 1.0),), 0.0659998, (-0.0076644, -0.099978, -0.0924839),
        (-0.0005099, 0.0001881, 0.0001365, -0.0003694, 6.68e-05, -0.000479),
    ),
    _Link(
        6, -pi / 2, 0.0, 0.0, pi / 2, ((5, 1.0),), 0.0499978, (0.0636551, 0.0028931, -0.0732851),
        (-0.0001555, -5.47e-05, -0.000104, -0.0002185, -9.8e-06, 1.17e-05),
    ),
    _Link(
        7, -pi / 2, 0.0, 0.0, pi, ((6, 1.0),), 0.0199972, (0.1003794, 0.0005238, 0.0007459),
        (-1.3e-06, 8.4e-06, -6.4e-06, -5.55e-05, -8.5e-06, -5.89e-05),
    ),
)  # fmt: skip
"""Outer yaw, upper arm, forearm, crank and bar of the parallelogram, platform, wrist pitch, yaw and roll."""

FRICTION = (
    (0.0490775, 0.048851),
    (0.0925067, 0.0317147),
    (0.0619387, 0.0432045),
    (0.0041764, 0.018664),
    (0.0006978, 0.0069851),
    (0.0022789, 0.0018971),
    (0.0001006, 0.0011894),
)
"""Viscous (N m s/rad) and Coulomb friction (N m) of the motors that drive the seven joints.

The elbow's is that of the crank, the platform's that of its motor (row 10).
"""


def _frames(q: Vector) -> Vector:
    """Return the frames of the links in the base, shape (9, 4, 4)."""
    frames = np.empty((len(_LINKS), 4, 4))
    for i, link in enumerate(_LINKS):
        angle = link.offset + sum(factor * q[joint] for joint, factor in link.turns)
        c, s, ca, sa = np.cos(angle), np.sin(angle), np.cos(link.alpha), np.sin(link.alpha)
        step = np.array(
            [
                [c, -s, 0.0, link.a],
                [s * ca, c * ca, -sa, -sa * link.d],
                [s * sa, c * sa, ca, ca * link.d],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
        frames[i] = step if link.parent < 0 else frames[link.parent] @ step
    return frames


def _pseudo_inertias() -> Vector:
    """Return the pseudo-inertias of the links in their own frames, shape (9, 4, 4)."""
    result = np.zeros((len(_LINKS), 4, 4))
    for link, frame, pseudo in zip(_LINKS, _frames(np.zeros(7)), result, strict=True):
        xx, xy, xz, yy, yz, zz = link.tensor
        turn = frame[:3, :3]
        tensor = turn.T @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn
        centre = turn.T @ np.array(link.centre)
        pseudo[:3, :3] = np.trace(tensor) / 2.0 * np.eye(3) - tensor + link.mass * np.outer(centre, centre)
        pseudo[:3, 3] = pseudo[3, :3] = link.mass * centre
        pseudo[3, 3] = link.mass
    return result


_PSEUDO = _pseudo_inertias()


def _slopes(q: Vector) -> Vector:
    """Return the derivatives of the links' frames by the joints, shape (7, 9, 4, 4)."""
    steps = _INSTANT * np.eye(7)
    return np.array([(_frames(q + step) - _frames(q - step)) / (2.0 * _INSTANT) for step in steps])


def inertia_matrix(q: Vector) -> Vector:
    """Return the inertia matrix at joint positions `q`, shape (7, 7), kg m^2."""
    slopes = _slopes(q)
    return np.einsum("ilab,lbc,jlac->ij", slopes, _PSEUDO, slopes)


def gravity(q: Vector) -> Vector:
    """Return the effort that holds the arm against gravity, base upright, shape (7,), N m."""
    return _G * np.einsum("ilb,lb->i", _slopes(q)[:, :, 2], _PSEUDO[:, :, 3])
