"""Arm and gripper (jaw or hand) together: commands, and reports of ended or abandoned moves."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum

import numpy as np

from controllers.motion.axes import Axes, Mode
from controllers.motion.following import clip
from controllers.motion.frames import rotate_twist
from controllers.motion.impedance import Impedance
from controllers.motion.master import PLATFORM, platform_effort
from controllers.motion.messages import Messages
from controllers.motion.params import AnyParams, MtmlParams, MtmrParams, PsmParams
from controllers.motion.setpoint import Setpoint
from controllers.motion.telemetry import body_to_spatial
from hub.participant import Record, array, choice, flag
from robots.serial_chain import SerialChain
from schemas.crtk import CartesianImpedance
from schemas.vectors import Vector

__all__ = ["Drives", "WrenchFrame"]


class WrenchFrame(IntEnum):
    """Frame of a commanded wrench.

    At the tip along the tip's axes (or the reference's, see `DrivesState`), at the base frame's origin along
    the base frame's axes, at the tip along the reference's axes, or by the impedance.
    """

    NONE = 0
    BODY = 1
    SPATIAL = 2
    REFERENCE = 3
    IMPEDANCE = 4


class DrivesState(Record):
    """State of the Cartesian control of an arm."""

    wrench = array(6)
    """Commanded force and torque."""
    frame = choice(WrenchFrame.NONE)
    absolute = flag()
    """Whether body wrenches are along the axes of the reference."""
    cartesian = flag()
    """Whether the arm executes a Cartesian command."""


class Drives:
    """The joints of an arm, and the gripper if any."""

    def __init__(self, arm: AnyParams, messages: Messages, base: Callable[[], Vector]) -> None:
        """Build arm and gripper.

        Args:
            arm: parameters of the arm.
            messages: events of the arm, for the end of a move.
            base: returns the base frame in the reference, shape (4, 4).
        """
        self._messages, self._base = messages, base
        self.joints = Axes(arm.chain, np.array(arm.start))
        gripper = arm.gripper
        self.gripper = (
            None if gripper is None else Axes(SerialChain(gripper.joints, np.eye(4)), np.array(gripper.start))
        )
        self.has_gripper = self.gripper is not None
        """Whether the instrument held has the gripper."""
        self.groups = (self.joints,) if self.gripper is None else (self.joints, self.gripper)
        """Driven joints: the arm's joints, then the gripper."""
        self._is_master = isinstance(arm, MtmlParams | MtmrParams)
        self._idle_gripper = Mode.POSITION if self._is_master else Mode.OFF
        self.control = DrivesState()
        self._impedance = Impedance()
        self.state = (
            self.control,
            self._impedance.state,
            *(part for axes in self.groups for part in axes.state),
        )

    def fit(self, arm: PsmParams) -> None:
        """Take over the instrument of `arm`: kinematics, limits, and whether there is a jaw."""
        self.joints.fit(arm.chain)
        if self.gripper is None:
            return
        self.has_gripper = bool(arm.end_effector.joints)
        if self.has_gripper:
            self.gripper.fit(SerialChain(arm.end_effector.joints, np.eye(4)))

    @property
    def is_moving(self) -> bool:
        """Whether a move of the arm or of the gripper is under way."""
        return any(axes.is_moving for axes in self.groups)

    @property
    def modes(self) -> tuple[Mode, Mode]:
        """Modes of arm and gripper; a missing gripper is off, that of a master in its hand."""
        return self.joints.mode, self._idle_gripper if self.gripper is None else self.gripper.mode

    def power(self, *, on: bool) -> None:
        """Switch all drives off, or on to hold the present positions."""
        self._abandon_move(*self.groups)
        self._leave()
        for axes in self.groups:
            axes.power(on=on and (axes is self.joints or self.has_gripper))

    def rest(self) -> None:
        """Brake and stay; a pressing gripper goes on pressing."""
        self._abandon_move(*self.groups)
        self._leave()
        for axes in self.groups:
            if axes is self.joints or axes.mode is Mode.POSITION:
                axes.hold()

    def follow(self, axes: Axes, goal: Vector, h: float, velocity: Vector | None = None) -> None:
        """Let `axes` follow a goal; arguments as of `Setpoint.follow`.

        Raises MotionError for a goal out of range.
        """
        goal = axes.chain.within(goal)
        self._take_over(axes)
        axes.follow(goal, h, velocity)

    def drift(self, velocity: Vector) -> None:
        """Let the arm move with joint velocities, shape (n,), as long as velocities are sent again."""
        self._take_over(self.joints)
        self.joints.drift(velocity)

    def move(self, axes: Axes, goal: Vector, ratio: Vector) -> None:
        """Let `axes` move to a goal; arguments as of `Axes.move`.

        Raises MotionError for a goal out of range.
        """
        goal = axes.chain.within(goal)
        if axes is self.joints:
            self._leave()
        axes.move(goal, ratio)

    def apply(self, axes: Axes, effort: Vector) -> None:
        """Let `axes` apply efforts, shape (n,)."""
        self._take_over(axes)
        axes.apply(effort)

    def press(self, wrench: Vector, frame: WrenchFrame) -> None:
        """Apply `wrench`, shape (6,), with the arm from now on, in any motion."""
        self._take_over(self.joints)
        self.control.wrench[:], self.control.frame = wrench, frame
        self._balance()

    def resist(self, message: CartesianImpedance) -> None:
        """Let the arm be held by springs and dampers. Raises MotionError if the message is invalid."""
        self._impedance.set(message)
        self._take_over(self.joints)
        self.control.frame = WrenchFrame.IMPEDANCE
        self._balance()

    def step(self, h: float) -> list[Setpoint]:
        """Advance by `h` seconds, except setpoints following a stream; return the latter."""
        if self.control.frame is not WrenchFrame.NONE:
            self._balance()
        following: list[Setpoint] = []
        for axes in self.groups:
            if axes.is_following:
                following.append(axes.setpoint)
            else:
                axes.step(h)
        return following

    def report_arrivals(self, *, silent: bool) -> None:
        """Report moves arrived since the last step; `silent`: without the homing arm's."""
        for axes in self.groups:
            if axes.pop_finished() and not (silent and axes is self.joints):
                self._messages.goal_reached(reached=True)

    def _take_over(self, axes: Axes) -> None:
        self._abandon_move(axes)
        if axes is self.joints:
            self._leave()

    def _leave(self) -> None:
        """End the last Cartesian command."""
        self.control.frame, self.control.cartesian = WrenchFrame.NONE, False

    def _abandon_move(self, *groups: Axes) -> None:
        if any(axes.is_moving for axes in groups):
            self._messages.goal_reached(reached=False)

    def _balance(self) -> None:
        """Apply the joint efforts J^T w, within the limits of the drives."""
        chain, frame = self.joints.chain, self.control.frame
        if frame is not WrenchFrame.IMPEDANCE and not self.control.wrench.any():
            self._float()
            return
        frames = chain.frames(self.joints.position)
        if frame in (WrenchFrame.REFERENCE, WrenchFrame.IMPEDANCE) or (
            frame is WrenchFrame.BODY and self.control.absolute
        ):
            jacobian = chain.jacobian(frames)
            wrench = self._in_base(frames[-1], jacobian)
        else:
            jacobian, wrench = chain.jacobian(frames, frame="tip"), self.control.wrench
            if frame is WrenchFrame.SPATIAL:
                jacobian = body_to_spatial(frames[-1]) @ jacobian
        self._apply(jacobian.T @ wrench)

    def _float(self) -> None:
        """Apply no wrench: as a master does while its instrument follows."""
        self._apply(np.zeros(len(self.joints.chain.joints)))

    def _apply(self, effort: Vector) -> None:
        """Apply joint efforts, shape (n,), and of a master the platform's own, within the drives' limits."""
        chain, n = self.joints.chain, len(effort)
        if self._is_master and self.control.frame is not WrenchFrame.SPATIAL:
            effort[PLATFORM] += platform_effort(chain, self.joints.position, self.joints.measured[n : 2 * n])
        self.joints.apply(clip(effort, -chain.effort, chain.effort))

    def _in_base(self, tip: Vector, jacobian: Vector) -> Vector:
        """Return the wrench at the tip, shape (6,), along the axes of the base frame, not the reference's."""
        base, n = self._base(), len(self.joints.chain.joints)
        wrench = self.control.wrench
        if self.control.frame is WrenchFrame.IMPEDANCE:
            wrench = self._impedance.wrench(
                base @ tip, rotate_twist(base[:3, :3], jacobian @ self.joints.measured[n : 2 * n])
            )
        return rotate_twist(base[:3, :3].T, wrench)
