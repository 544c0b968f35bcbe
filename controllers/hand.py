"""A hand that leads a master: it follows a path, or the pose of any device or recording.

The hand takes hold of the gripper where the gripper is, and from then on moves it as its path or its device
moves:

    x = x0 + s R (d - d0),    X = (R D D0' R') X0,

with x and X position and orientation of the hand in the stereo viewer's frame, d and D of the device, R the
orientation of the device's frame in the viewer's, s the scale, and 0 for the moment of the grip. The engine
holds master and hand together by a spring and damper, so that the hand feels what is commanded to the master.
A hand whose device is silent lets go: the master then hangs in its gravity compensation.
"""

from __future__ import annotations

from itertools import pairwise
from math import cos, pi, radians
from typing import Annotated, Any, ClassVar, Literal, cast

import numpy as np
from pydantic import AfterValidator, Field

from controllers.least_jerk import least_jerk
from controllers.ports import NO_POSE
from hub.participant import (
    Controller,
    Inputs,
    Outputs,
    Params,
    Record,
    Setup,
    array,
    event_in,
    event_out,
    flag,
    number,
    signal_in,
    signal_out,
)
from robots import rotation
from robots.dvrk.mtm import DISPLAY_FRAME, GRIPPER_OPEN
from robots.dvrk.parameters import UnitQuaternion
from schemas.ports import Port
from schemas.quantity import Angle, Duration, Length
from schemas.ros import BoolMessage, Float64Message, JointState, Joy, PoseStamped, StringMessage
from schemas.vectors import Vector

__all__ = ["Hand", "HandParams", "Waypoint"]

_DESK_IN_VIEW = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""Away (x) on the desk is ahead (z) in the viewer, left (y) is left (x), up (z) is up (y)."""
_RISE = 0.1
"""Time in which a hand takes hold or lets go, s; assumed."""
_RATE = radians(360.0)
"""rad/s of the fingers; assumed."""
_SQUEEZE, _SQUEEZES = radians(50.0), 1.0
"""Way of the gripper, rad, and frequency, Hz, by which a hand shows that it is there before it leads."""
_NO_GRIPPER = -1.0


class Waypoint(Params):
    """A pose on the path of a hand, relative to where it took hold."""

    at: Duration = Field(ge=0, description="after the hand has taken hold")
    position: tuple[Length, Length, Length] = Field(
        default=(0.0, 0.0, 0.0), description="way to the left, up and ahead in the picture"
    )
    turn: tuple[Angle, Angle, Angle] = Field(
        default=(0.0, 0.0, 0.0), description="rotation vector along the same axes"
    )
    gripper: Angle = Field(default=radians(30.0), ge=0.0, le=GRIPPER_OPEN, description="opening")


def _check_order(path: tuple[Waypoint, ...]) -> tuple[Waypoint, ...]:
    if any(one.at >= other.at for one, other in pairwise(path)):
        raise ValueError("the times of a path must rise from waypoint to waypoint")
    return path


class HandParams(Params):
    """The master that is held, and the path of the hand."""

    open_to_pages: ClassVar[bool] = True

    arm: Literal["MTML", "MTMR"] = "MTMR"
    path: Annotated[tuple[Waypoint, ...], AfterValidator(_check_order)] = Field(
        default=(),
        description=(
            "of a hand without a device, smooth between waypoints; repeated if it ends where it began"
        ),
    )
    scale: float = Field(
        default=1.0, gt=0.0, allow_inf_nan=False, description="metres of the hand per metre of the device"
    )
    registration: UnitQuaternion = Field(
        default=(0.0, 0.0, 0.0, 1.0),
        description="orientation of the device's frame on the desk (x away, y left, z up)",
    )
    engage: Literal["released", "held"] = Field(
        default="released",
        description="the hand holds unless button 0 of the device is pressed, or only while it is pressed",
    )
    max_age: Duration = Field(
        default=100_000_000, gt=0, description="the hand lets go when its device has been silent for longer"
    )


class HandState(Record):
    """State of a hand; poses are (x, y, z, qx, qy, qz, qw)."""

    grip = number()
    """How firmly it holds, 0 to 1."""
    holds = flag()
    """Whether it holds, or is about to."""
    pressed = flag()
    jaw = flag()
    """Button 1 of the device: closes the gripper."""
    following = flag()
    """Whether the instrument follows the master."""
    time = number()
    """s since the hand took hold; before that, since it began to squeeze."""
    gripper = number(radians(30.0))
    """Opening commanded to the gripper, rad."""
    pose = array(7)
    """Pose of the hand in the viewer's frame."""
    start = array(7)
    """Pose of the gripper when the hand took hold."""
    device = array(7)
    """Pose of the device when the hand took hold."""


class Hand(Controller):
    """Leads a master by its gripper."""

    params_model: ClassVar[type[Params]] = HandParams
    params: HandParams

    def __init__(self, name: str, params: HandParams) -> None:
        super().__init__(name, params)
        self._now = HandState()
        self._now.pose[6] = 1.0
        self.keep(self._now)
        registered = rotation.product(rotation.from_matrix(_DESK_IN_VIEW), np.array(params.registration))
        self._to_viewer = rotation.matrix(registered)
        rest = Waypoint(at=0)
        path = params.path if params.path and not params.path[0].at else (rest, *params.path)
        self._times = [one.at * 1e-9 for one in path]
        self._rows = np.array([[*one.position, *one.turn, one.gripper] for one in path])  # (waypoints, 7)
        self._waits = self._has_device = False
        self._outputs: dict[str, Any] = {
            f"{params.arm}/hand_cp": self._now.pose,
            f"{params.arm}/hand_grip": self._now.part("grip"),
            f"{params.arm}/gripper/servo_jp": self._now.part("gripper"),
            "warning": (),
        }

    @property
    def ports(self) -> tuple[Port, ...]:
        """Device and master in; the hand on the master out."""
        arm, age = self.params.arm, self.params.max_age
        buttons = "button 0: see `engage`; button 1: closes the gripper"
        gripper = "of the device, 0 closed .. 1 open; negative: none, the button closes the gripper"
        following = "whether the instrument follows: the hand holds only then; not connected: it always holds"
        return (
            signal_in("pose", PoseStamped, "of the device that leads", max_age_ns=age, start=NO_POSE),
            event_in("buttons", Joy, buttons),
            signal_in("gripper", Float64Message, gripper, start=(_NO_GRIPPER,)),
            event_in("following", BoolMessage, following),
            signal_in("master", PoseStamped, "measured_cp of the master", frame=DISPLAY_FRAME),
            signal_out(f"{arm}/hand_cp", PoseStamped, "of the hand", frame=DISPLAY_FRAME),
            signal_out(f"{arm}/hand_grip", Float64Message, "how firmly the hand holds, 0 to 1"),
            signal_out(f"{arm}/gripper/servo_jp", JointState, "opening of the gripper", names=("gripper",)),
            event_out("warning", StringMessage, "why the hand lets go"),
        )

    def configure(self, setup: Setup) -> Outputs:
        """Start with open fingers."""
        self._has_device = "pose" in setup.connected
        self._waits = "following" in setup.connected
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Move the hand, if it holds."""
        now, seconds = self._now, h * 1e-9
        self._receive(inputs)
        lost = self._has_device and inputs.stale("pose")
        self._outputs["warning"] = ()
        self._take_hold(inputs, lost=lost)
        now.time += seconds
        most = seconds / _RISE
        now.grip += min(max(float(now.holds) - now.grip, -most), most)
        if now.holds:
            self._move(inputs)
        goal, way = self._opening(inputs, lost=lost), _RATE * seconds
        now.gripper += min(max(goal - now.gripper, -way), way)
        return self._outputs

    def _receive(self, inputs: Inputs) -> None:
        if inputs.quiet:
            return
        for joy in cast("tuple[Joy, ...]", inputs.events("buttons")):
            if joy.buttons.size:
                self._now.pressed = bool(joy.buttons[0] != 0)
            if joy.buttons.size > 1:
                self._now.jaw = bool(joy.buttons[1] != 0)
        for message in cast("tuple[BoolMessage, ...]", inputs.events("following")):
            self._now.following = message.data

    def _take_hold(self, inputs: Inputs, *, lost: bool) -> None:
        """Take hold of the gripper, or let it go."""
        now = self._now
        engaged = now.pressed is (self.params.engage == "held") or not self._has_device
        holds = engaged and not lost and (now.following or not self._waits)
        if holds and not now.holds:
            now.start[:] = now.pose[:] = inputs["master"]
            now.device[:] = inputs["pose"]
            now.time = 0.0
        elif now.holds and not holds:
            now.time = 0.0
            if lost:
                silent = f"its device has been silent for more than {self.params.max_age / 1e6:g} ms"
                self._outputs["warning"] = (StringMessage(data=f"{self.params.arm} hangs: {silent}"),)
        now.holds = holds

    def _move(self, inputs: Inputs) -> None:
        """Set the pose of the hand by the device, or by the path."""
        now = self._now
        if self._has_device:
            way = self._to_viewer @ (inputs["pose"][:3] - now.device[:3])
            turned = rotation.product(inputs["pose"][3:], rotation.conjugate(now.device[3:]))
            turn = self._to_viewer @ rotation.log(turned)
            way *= self.params.scale
        else:
            way, turn, _ = np.split(self._on_path(), [3, 6])
        now.pose[:3] = now.start[:3] + way
        orientation = rotation.product(rotation.exp(turn), now.start[3:])
        now.pose[3:] = orientation / np.linalg.norm(orientation)

    def _on_path(self) -> Vector:
        """Return way, turn and opening of the path now, shape (7,)."""
        times, rows = self._times, self._rows
        since = self._now.time
        if since >= times[-1] and (rows[0, :6] == rows[-1, :6]).all() and len(times) > 1:
            since = times[0] + (since - times[0]) % (times[-1] - times[0])
        i = min(max(int(np.searchsorted(times, since, side="right")) - 1, 0), len(times) - 2)
        if len(times) == 1 or since >= times[-1]:
            return rows[-1]
        share = least_jerk(max(since - times[i], 0.0) / (times[i + 1] - times[i]))
        return rows[i] + share * (rows[i + 1] - rows[i])

    def _opening(self, inputs: Inputs, *, lost: bool) -> float:
        """Return the opening of the gripper that the hand wants, rad."""
        now = self._now
        if lost:
            return now.gripper
        if self._has_device:
            gripper = float(inputs["gripper"][0])
            if gripper >= 0.0:
                return min(gripper, 1.0) * GRIPPER_OPEN
            if now.following or not self._waits:
                return 0.0 if now.jaw else 0.5 * GRIPPER_OPEN
        elif now.holds:
            return float(self._on_path()[6])
        return 0.5 * (GRIPPER_OPEN + _SQUEEZE * cos(2.0 * pi * _SQUEEZES * now.time))
