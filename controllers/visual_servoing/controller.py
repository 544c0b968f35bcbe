"""Visual servoing of the endoscope as a participant: pictures in, commands to the ECM out.

With each picture it finds the discs, and from then to the next one it moves the command by the law's joint
velocities. It holds while the arm is not ready, while no picture comes, and while fewer than four discs are
seen: it neither moves blindly nor towards what it guesses. Discs seen again are recognised again by
where they were last.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Any, ClassVar, cast

import numpy as np

from controllers.pictures import PictureController
from controllers.visual_servoing.blobs import find_blobs
from controllers.visual_servoing.camera import kept_view
from controllers.visual_servoing.law import MotionLimits, joint_velocities
from controllers.visual_servoing.params import ServoingParams
from controllers.visual_servoing.ports import servoing_ports
from controllers.visual_servoing.target import recognise_target
from hub.participant import (
    Inputs,
    Outputs,
    Params,
    Record,
    Setup,
    array,
    choice,
    flag,
    integer,
    number,
)
from robots import rotation
from robots.dvrk import crtk, ecm
from robots.dvrk.endoscope import left_camera
from schemas.crtk import OperatingState
from schemas.ports import Port
from schemas.ros import CameraInfo, Float64MultiArray, Image, StringMessage
from schemas.vectors import Vector

__all__ = ["ServoingPhase", "VisualServoing"]

_JOINTS = len(ecm.JOINT_NAMES)
_APPROACH = 3.0
"""1/s, of `Limits.approach`: faster than the features converge with the default gain, so that a limit which
is not the goal's own does not slow them.
"""
_REST = 0.004
"""Share of the joints' speed limits below which the endoscope rests; noise of 0.2 px stays below."""
_REST_NS = 500_000_000
"""Resting for so long away from the goal, it has settled."""
_LEAVE = 2.0
"""A reached goal is left when the error is above the tolerance by this factor."""


class ServoingPhase(IntEnum):
    """What it does."""

    WAITING = 0
    BLIND = 1
    SEARCHING = 2
    MOVING = 3
    REACHED = 4
    SETTLED = 5


class ServoingState(Record):
    """Command, goal, and what was seen last."""

    command = array(2, _JOINTS)
    """Positions, then velocities."""
    camera_velocity = array(6)
    goal = array(4, 2)
    """Normalised."""
    features = array(4, 2)
    """Normalised, as seen last; the goal before."""
    shown = array(4, 2)
    """The same in pixels."""
    shown_goal = array(4, 2)
    pose = array(7)
    """Pose of the target in the camera's frame: position and quaternion."""
    camera = array(6)
    """fx, fy, cx, cy, width and height, px; zeros before the first camera_info."""
    error = number()
    """px."""
    seen = flag()
    """Whether the newest picture has all four discs."""
    picture_ns = integer(-1)
    """Stamp of the newest picture; -1 before."""
    rests_since_ns = integer(-1)
    phase = choice(ServoingPhase.WAITING)
    ready = flag(start=True)
    started = flag()


class VisualServoing(PictureController):
    """An endoscope, one target of four discs."""

    params_model: ClassVar[type[Params]] = ServoingParams
    params: ServoingParams
    kind = "visual-servoing"

    def __init__(self, name: str, params: ServoingParams) -> None:
        super().__init__(name, params)
        self._chain = left_camera(params.endoscope, params.baseline)
        self._points = np.column_stack([np.array(params.points), np.zeros(4)])  # (4, 3)
        self._now = ServoingState()
        self.keep(self._now)

    @property
    def ports(self) -> tuple[Port, ...]:
        """The left eye's pictures, a goal and the ECM's state in; its command and what is seen out."""
        return servoing_ports(self.params)

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start with the arm held where the parameters state it. Raises MissingExtraError without OpenCV."""
        self._load_opencv()
        now = self._now
        now.command[0], now.goal[:] = self.params.start, self.params.goal
        now.features[:], now.pose[6] = now.goal, 1.0
        return self._outputs(ServoingPhase.WAITING)

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Look at the newest picture, and move the command on."""
        now, before = self._now, self._now.phase
        self._warnings.clear()
        self._receive(inputs)
        if not now.started and now.ready:
            measured = inputs["measured_js"][:_JOINTS]
            now.command[0] = np.clip(measured, self._chain.lower, self._chain.upper)
            now.started = True
        self._look(inputs.events("left/image_raw"))
        now.phase = self._current_phase(t)
        if now.phase < ServoingPhase.MOVING:
            now.command[1], now.camera_velocity[:], now.rests_since_ns = 0.0, 0.0, -1
        else:
            self._steer_command(t, h * 1e-9)
        return self._outputs(before)

    def _receive(self, inputs: Inputs) -> None:
        now = self._now
        for state in cast("tuple[OperatingState, ...]", inputs.events("operating_state")):
            now.ready = crtk.is_ready(state)
            now.started = now.started and now.ready
        for info in cast("tuple[CameraInfo, ...]", inputs.events("left/camera_info")):
            fx, fy, cx, cy = info.k[[0, 4, 2, 5]].tolist()
            if min(fx, fy) > 0.0 and min(info.width, info.height) > 0 and not info.d.any():
                now.camera[:] = fx, fy, cx, cy, info.width, info.height
            else:
                self._warn(
                    f"camera_info with focal lengths {fx:g}, {fy:g} px and distortion {info.d.tolist()} is"
                    " refused: the picture must be rectified"
                )
        for goal in cast("tuple[Float64MultiArray, ...]", inputs.events("goal")):
            if goal.data.size == now.goal.size and np.isfinite(goal.data).all():
                now.goal[:] = goal.data.reshape(4, 2)
                now.rests_since_ns = -1
            else:
                self._warn(
                    f"a goal of {goal.data.size} numbers is refused: eight finite ones are needed, x and y of"
                    " each disc"
                )

    def _look(self, pictures: tuple[Any, ...]) -> None:
        """Find the discs in the newest picture."""
        now = self._now
        if not pictures or not now.camera[0]:
            return
        image = cast("Image", pictures[-1])
        fx, fy, cx, cy, width, height = now.camera.tolist()
        picture = self._accepted_pixels(image, width, height)
        if picture is None:
            return
        now.picture_ns = image.header.stamp.ns
        intrinsics = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        blobs = find_blobs(self._cv2, picture)
        sight = recognise_target(self._cv2, blobs, intrinsics, self._points, self.params.radius, now.features)
        now.seen = sight is not None
        if sight is not None:
            now.features[:] = sight.features
            now.shown[:] = sight.features * (fx, fy) + (cx, cy)
            now.pose[:3], now.pose[3:] = sight.pose[:3, 3], rotation.from_matrix(sight.pose)

    def _current_phase(self, t: int) -> ServoingPhase:
        now = self._now
        if not (now.ready and now.started):
            return ServoingPhase.WAITING
        if self._is_blind(t, now.picture_ns):
            return ServoingPhase.BLIND
        if not now.seen:
            return ServoingPhase.SEARCHING
        now.shown_goal[:] = now.goal * now.camera[:2] + now.camera[2:4]
        now.error = float(np.hypot(*(now.shown - now.shown_goal).T).max())
        within = self.params.tolerance * (_LEAVE if now.phase is ServoingPhase.REACHED else 1.0)
        if now.error <= within:
            return ServoingPhase.REACHED
        return ServoingPhase.SETTLED if 0 <= now.rests_since_ns <= t - _REST_NS else ServoingPhase.MOVING

    def _steer_command(self, t: int, seconds: float) -> None:
        """Move the command by `seconds` of the law's velocities."""
        now, chain = self._now, self._chain
        q = now.command[0]
        jacobian = chain.jacobian(chain.frames(q), frame="tip")
        depths = self._points @ rotation.matrix(now.pose[3:])[2] + now.pose[2]
        limits = self._limits(depths)
        velocities = joint_velocities(
            self.params.law, q, jacobian, now.features, now.goal, depths, self.params.gain, limits
        )
        goal = np.clip(q + velocities * seconds, chain.lower, chain.upper)
        now.command[1] = (goal - q) / seconds
        now.command[0] = goal
        now.camera_velocity[:] = jacobian @ now.command[1]
        if abs(velocities / chain.velocity).max() > _REST:
            now.rests_since_ns = -1
        elif now.rests_since_ns < 0:
            now.rests_since_ns = t

    def _limits(self, depths: Vector) -> MotionLimits:
        """Return the limits, whose view leaves room for the nearest of the discs, `depths` (4,), m."""
        now, chain = self._now, self._chain
        view = kept_view(now.camera, self.params.radius / float(depths.min()), self.params.margin)
        return MotionLimits(chain.lower, chain.upper, chain.velocity, view, _APPROACH)

    def _outputs(self, before: ServoingPhase) -> Outputs:
        now = self._now
        changed = now.phase is not before
        if changed and now.phase is ServoingPhase.SETTLED:
            self._warn(
                f"at rest {now.error:.3g} px from the goal, the nearest in least squares that four joints"
                " allow within their ranges and with all discs in view"
            )
        return {
            "servo_jp": now.command.reshape(-1),
            "camera_velocity": now.camera_velocity,
            "features": now.shown.reshape(-1),
            "features_goal": now.shown_goal.reshape(-1),
            "feature_error": now.part("error"),
            "target/measured_cp": now.pose,
            "state": (StringMessage(data=now.phase.name.lower()),) if changed else (),
            "warning": tuple(self._warnings),
        }
