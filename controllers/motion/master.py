"""Abilities of masters alone: a locked orientation, a platform that follows the wrist, a gripper.

Laws and numbers are the real controller's (SAW = jhu-dvrk/sawIntuitiveResearchKit,
mtsIntuitiveResearchKitMTM.cpp and .h).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import cos, pi
from typing import Any

import numpy as np

from controllers.motion import goals
from controllers.motion.frames import BaseFrame
from controllers.motion.messages import Messages
from hub.participant import Inputs, Record, array, flag, number
from robots.dvrk.mtm_inverse import wrist_angles
from robots.serial_chain import SerialChain
from schemas.ros import EmptyMessage, Quaternion
from schemas.vectors import Vector

__all__ = ["PLATFORM", "MasterGripper", "OrientationLock", "platform_effort"]

PLATFORM, _PITCH, _YAW = 3, 4, 5
"""Indices of joints; the joints from the platform on hold a locked orientation."""
_GAIN, _PROPORTIONAL, _DERIVATIVE, _MOST_EFFORT = 0.5, 1.0, 0.1, 0.4
"""Share, N m/rad, N m s/rad and N m of the platform's effort (SAW mtsIntuitiveResearchKit.h, MTMPlatform)."""
_MOST_WAY = 0.05 * pi
"""Largest distance of the platform from its goal that counts, rad."""
_CLOSED, _DEBOUNCE = 0.0, 0.2
"""Opening (rad) from which down the gripper counts as closed, and time (s) until that is published."""
_ROUNDING = 1e-3
"""Opening of handles that touch, rad: no simulated spring presses them to exactly 0."""


def platform_effort(chain: SerialChain, q: Vector, velocity: Vector) -> float:
    """Return the effort, N m, that brings the platform to where the wrist yaw is in its middle."""
    joint = chain.joints[PLATFORM]
    way = min(max(float(q[_YAW]) * cos(float(q[_PITCH])), -_MOST_WAY), _MOST_WAY)
    goal = min(max(float(q[PLATFORM]) + way, joint.lower), joint.upper)
    effort = _GAIN * (_PROPORTIONAL * (goal - float(q[PLATFORM])) - _DERIVATIVE * float(velocity[PLATFORM]))
    return min(max(effort, -_MOST_EFFORT), _MOST_EFFORT)


class LockState(Record):
    """Whether the orientation is locked, and at which."""

    locked = flag()
    orientation = array(3, 3)
    """Locked orientation in the arm's base frame."""
    joints = array(7)
    """Joint positions when it was locked."""


class OrientationLock:
    """Holds the orientation of a master whose first joints apply efforts: `handlers`, by name."""

    def __init__(
        self, chain: SerialChain, base: BaseFrame, position: Callable[[], Vector], messages: Messages
    ) -> None:
        """Start unlocked.

        Args:
            chain: kinematics of the master.
            base: the arm's base frame.
            position: returns the measured joint positions, shape (7,).
            messages: events of the arm.
        """
        self._chain, self._base, self._position, self._messages = chain, base, position, messages
        self.state = LockState()
        self.handlers: Mapping[str, Callable[[Any], None]] = {
            "lock_orientation": self._lock,
            "unlock_orientation": self._unlock,
        }

    @property
    def is_locked(self) -> bool:
        """Whether the orientation is to be held."""
        return self.state.locked

    def _lock(self, message: Quaternion) -> None:
        self.state.orientation[:] = self._base.pose[:3, :3].T @ goals.rotation_matrix(message)
        self.state.joints[:] = self._position()
        self.state.locked = True
        self._messages.orientation_locked(locked=True)

    def _unlock(self, _: EmptyMessage) -> None:
        self.state.locked = False
        self._messages.orientation_locked(locked=False)

    def goal(self) -> Vector:
        """Return joint positions, shape (7,), of the locked orientation where the gripper is now."""
        q, start = self._position().copy(), self.state.joints
        forearm = self._chain.frames(np.where(np.arange(7) < PLATFORM, q, 0.0))[PLATFORM, :3, :3]
        platform = float(start[PLATFORM])
        wrist = wrist_angles(self._chain, forearm, platform, self.state.orientation, start)
        q[PLATFORM:] = platform, *wrist
        return np.clip(q, self._chain.lower, self._chain.upper)


class GripperState(Record):
    """A master's gripper."""

    measured = array(3)
    """Opening (rad), its velocity and effort."""
    closed = flag()
    published = flag(start=True)
    """Whether clients know whether it is closed."""
    waited = number()
    """Time since that changed, s."""


class MasterGripper:
    """Measures the gripper of a master, and publishes when it closes and opens."""

    def __init__(self, arm: str, start: float, messages: Messages) -> None:
        """`start`: opening at time 0, rad."""
        self._port, self._messages = f"sense/{arm}/gripper/measured_js", messages
        self.state = GripperState()
        self.state.measured[0] = start
        self.measured = np.array(self.state.measured)
        """Last published opening, velocity and effort."""

    def sense(self, inputs: Inputs) -> None:
        """Read the measurement."""
        self.state.measured[:] = inputs[self._port]

    def step(self, h: float) -> None:
        """Publish a closing or an opening that has lasted, `h` seconds after the last call."""
        state = self.state
        closed = bool(state.measured[0] <= _CLOSED + _ROUNDING)
        if closed is not state.closed:
            state.closed, state.published, state.waited = closed, False, 0.0
        if state.published:
            return
        state.waited += h
        if state.waited > _DEBOUNCE:
            state.published = True
            self._messages.gripper(closed=closed)

    def publish(self) -> None:
        """Copy the measurement to the output."""
        self.measured[:] = self.state.measured
