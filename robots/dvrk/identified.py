"""The identified dynamics of the PSM in combined terms.

The masses of `robots.dvrk.arm_bodies` are fitted to them and tested against them.

Source: FONT = gafontanelli/DVRK-dynamicModel (commit 51c55d75), dvrk_dynamics/src/PSM_robot.cpp with its
parameters PSM1_param.txt; Fontanelli, Ficuciello, Villani, Siciliano, "Modelling and identification of the da
Vinci Research Kit robotic arms", IROS 2017. Its single masses are not physical (3000 kg): only sums of them
can be identified from measurements. Here the sums stand, one for each function of q in the model. It was
identified with the base upright, an instrument mounted and a force sensor of 0.0917 kg on the carriage, all
part of the moving masses. SI units, radians; q = yaw, pitch, insertion.
"""

from __future__ import annotations

import numpy as np

from schemas.vectors import Vector

__all__ = ["COUNTERWEIGHT_MASS", "INSERTION_MASS", "elastic_torque", "gravity", "inertia_matrix"]

_G = 9.81
"""m/s^2, as in FONT."""

INSERTION_MASS = 0.2377
"""Mass moving down with the insertion, instrument included, kg (mass5)."""
COUNTERWEIGHT_MASS = 0.179
"""Mass moving up with the insertion, kg (mass9)."""

_SLIDING = INSERTION_MASS + COUNTERWEIGHT_MASS
_SLIDING_MOMENT = -0.01381624
"""kg m: 2 mpz5 - 0.0312 mass5 + 0.4 mass9, growth of yaw and pitch inertia with the insertion."""
_YAW = (-0.0545271, 0.238137804, 0.02397645171, 0.04963771668, 0.033)
"""kg m^2: yaw inertia at insertion 0 as sum over 1, cos q2, cos^2 q2, sin 2 q2; kg m: q3 sin 2 q2.

They are Ixx3 + Iyy1 + Ixx2 + Izz4 + Izz5 + Izz9; -0.4 mpy3; the rest of the terms in cos^2; -Ixz4 - Ixz5 -
0.2 mpx4 - 0.0156 mpx5; mpx5.
"""
_PITCH = 0.1970255324
"""kg m^2: pitch inertia at insertion 0."""
_YAW_PITCH = (0.01786926718, -0.0054044, 0.001)
"""kg m^2 by cos q2 and sin q2, kg m by q3 sin q2 (Ixy4 + Ixy5; 0.2 mpz3 - Iyz4 - Iyz5 - 0.2 mpy4 - 0.0156
mpy5; mpy5).
"""
_PITCH_INSERTION = 0.033
"""kg m (mpx5)."""

_YAW_MOMENT = (0.010492589, 0.009989)
"""kg m: first moment turning with the yaw alone, along -z and across (mpy3 - mpx1; mpy4 + mpy5 - mpz1 - mpz2
- mpz3).
"""
_PITCH_MOMENT = (0.0124121174, 0.0155191211)
"""kg m: first moment turning with the pitch, along the instrument and across (the terms of G in cos q2; mpx4
+ mpx5 + mpy2).
"""

_ELASTIC = ((0.135144709, 0.00726440463), (0.35571592, 0.0758960511), (0.0, 0.0), (0.0025, 0.0038))
"""N m/rad and N m by joint, yaw to roll (K and O)."""


def inertia_matrix(q: Vector) -> Vector:
    """Return the inertia matrix of yaw, pitch and insertion, shape (3, 3), kg m^2, kg m, kg.

    In the model the wrist has no inertia.
    """
    s, c, s2 = np.sin(q[1]), np.cos(q[1]), np.sin(2.0 * q[1])
    sliding = _SLIDING * q[2] ** 2 + _SLIDING_MOMENT * q[2]
    yaw = np.dot(_YAW, [1.0, c, c * c, s2, q[2] * s2]) + sliding * c * c
    yaw_pitch = np.dot(_YAW_PITCH, [c, s, q[2] * s])
    yaw_insertion = -_YAW_PITCH[2] * c
    return np.array(
        [
            [yaw, yaw_pitch, yaw_insertion],
            [yaw_pitch, _PITCH + sliding, _PITCH_INSERTION],
            [yaw_insertion, _PITCH_INSERTION, _SLIDING],
        ]
    )


def gravity(q: Vector) -> Vector:
    """Return the effort of gravity on yaw, pitch and insertion (N m, N m, N), shape (3,).

    The base is upright.
    """
    s1, c1, s2, c2 = np.sin(q[0]), np.cos(q[0]), np.sin(q[1]), np.cos(q[1])
    along, across = _PITCH_MOMENT[0] + (INSERTION_MASS - COUNTERWEIGHT_MASS) * q[2], _PITCH_MOMENT[1]
    yaw = s1 * (_YAW_MOMENT[0] + along * c2 + across * s2) + c1 * _YAW_MOMENT[1]
    return _G * np.array(
        [yaw, c1 * (along * s2 - across * c2), -(INSERTION_MASS - COUNTERWEIGHT_MASS) * c1 * c2]
    )


def elastic_torque(q: Vector) -> Vector:
    """Return the torque (N m) of cables and covers on yaw, pitch, insertion (none) and roll, shape (4,).

    Positions `q` have shape (4,).
    """
    stiffness, offset = np.array(_ELASTIC).T
    return stiffness * q[:4] + offset
