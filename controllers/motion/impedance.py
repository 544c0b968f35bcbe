"""Cartesian impedance: springs and dampers between the tip and a goal, with gains for either side of it.

The law of the real controller (jhu-saw/sawControllers, osaCartesianImpedanceController.cpp): with e the tip's
displacement and v the tip's velocity along the axes of an orientation, and the gains of the tip's side, f = p
e' + d v + bias, e' being e less the deadband. For the torque, e is the rotation vector from the goal's
orientation, along the axes of the goal.
"""

from __future__ import annotations

import numpy as np

from controllers.motion import goals
from hub.participant import Record, array
from robots import rotation
from schemas.crtk import CartesianImpedance, CartesianImpedanceHalfPlaneGains
from schemas.vectors import Vector

__all__ = ["Impedance"]


class ImpedanceState(Record):
    """The goal of an arm, with gains."""

    force_axes = array(3, 3)
    torque_axes = array(3, 3)
    """Axes of forces and torques, and the goal's orientation."""
    position = array(3)
    gains = array(4, 2, 2, 3)
    """p, d, bias and deadband; on the positive and on the negative side; of force and torque; x, y, z."""


class Impedance:
    """The goal of an arm, with gains."""

    def __init__(self) -> None:
        """Start with zeros."""
        self.state = ImpedanceState()
        self._force_axes, self._torque_axes = self.state.force_axes, self.state.torque_axes
        self._position, self._gains = self.state.position, self.state.gains

    def set(self, message: CartesianImpedance) -> None:
        """Set another goal.

        Raises MotionError, with the old goal kept, for a non-finite number or a quaternion not of unit norm.
        """
        axes = (
            goals.rotation_matrix(message.force_orientation),
            goals.rotation_matrix(message.torque_orientation),
        )
        position = goals.vector(message.force_position, "force_position")
        sides = (
            (message.position_positive, message.orientation_positive),
            (
                message.position_negative,
                message.orientation_negative,
            ),
        )
        gains = np.array([[_gains(half) for half in side] for side in sides])  # (2, 2, 4, 3)
        self._force_axes[:], self._torque_axes[:] = axes
        self._position[:], self._gains[:] = position, gains.transpose(2, 0, 1, 3)

    def wrench(self, tip: Vector, twist: Vector) -> Vector:
        """Return the wrench on the tip, shape (6,), in the frame of the goal.

        Args:
            tip: pose of the tip in the frame of the goal, shape (4, 4).
            twist: twist of the tip in the frame of the goal, shape (6,).
        """
        turn = rotation.log(rotation.from_matrix(self._torque_axes.T @ tip[:3, :3]))
        away = np.array([self._force_axes.T @ (tip[:3, 3] - self._position), turn])  # (2, 3)
        velocity = np.array([self._force_axes.T @ twist[:3], self._torque_axes.T @ twist[3:]])
        p, d, bias, deadband = np.where(away > 0.0, self._gains[:, 0], self._gains[:, 1])
        beyond = np.sign(away) * np.maximum(np.abs(away) - np.abs(deadband), 0.0)
        force, torque = p * beyond + d * velocity + bias
        return np.concatenate([self._force_axes @ force, self._torque_axes @ torque])


def _gains(half: CartesianImpedanceHalfPlaneGains) -> list[Vector]:
    return [goals.vector(part, "gains") for part in (half.p, half.d, half.bias, half.deadband)]
