"""An arm under CRTK, as seen by a program.

Names, frames and units are CRTK's (collaborative-robotics.github.io, "Robot motion commands" and "Robot
state"); `jaw`, `local`, `body` and `spatial` are those of the dVRK (jhu-dvrk/dvrk_python).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from time import time_ns
from typing import TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

from devices.programs.connection import Connection, Topic
from devices.programs.handles import ArmEvents, Handle, Move, StateChange
from devices.programs.values import Joints, Pose, Twist, Wrench
from schemas.codec import message_type
from schemas.crtk import OperatingState, StringStamped
from schemas.errors import MotionError
from schemas.message import Message
from schemas.ros import (
    EmptyMessage,
    Float64Message,
    Header,
    JointState,
    Point,
    PoseStamped,
    Quaternion,
    Time,
    TwistStamped,
    Vector3,
    WrenchStamped,
)
from schemas.ros import Pose as PoseMessage
from schemas.ros import Wrench as WrenchMessage
from schemas.vectors import Vector

__all__ = ["Arm", "JointGroup", "Tip"]

M = TypeVar("M", bound=Message)

_STATES: Mapping[str, Callable[[OperatingState], bool]] = {
    "enable": lambda s: s.state == "ENABLED" and not s.is_busy,
    "disable": lambda s: s.state == "DISABLED",
    "home": lambda s: s.is_homed and s.state == "ENABLED" and not s.is_busy,
    "unhome": lambda s: not s.is_homed,
    "pause": lambda s: s.state == "PAUSED",
    "resume": lambda s: s.state == "ENABLED",
}
"""Operating states reached by state commands, by command."""


class Operations:
    """CRTK operations under one prefix: `PSM1`, `PSM1/jaw`, `PSM1/local`."""

    def __init__(self, connection: Connection, events: ArmEvents, part: str = "") -> None:
        """`part`: prefix after the arm's name, such as `jaw/`."""
        self._connection, self._events, self._part = connection, events, part
        self._topics: dict[str, Topic[Message]] = {}

    @property
    def operations(self) -> tuple[str, ...]:
        """Names of all states, events and commands under this prefix."""
        prefix = self._topic("")
        names = (*self._connection.published, *self._connection.commands)
        return tuple(sorted({name.removeprefix(prefix) for name in names if name.startswith(prefix)}))

    def read(self, name: str) -> Message:
        """Return the newest message of a state or an event by its CRTK name, such as `measured_js`."""
        type_ = self._connection.type_of(self._topic(name), self._connection.published)
        return self._read(name, message_type(type_))

    def send(self, name: str, message: Message) -> None:
        """Send a command by its CRTK name, such as `servo_cs`.

        Raises MotionError if the arm has refused the last command of this name.
        """
        if refusal := self._events.take_refusal(self._part + name):
            raise MotionError(refusal)
        self._connection.send(self._topic(name), message)

    def _read(self, name: str, model: type[M]) -> M:
        topic = self._topics.get(name)
        if topic is None:
            address = self._topic(name)
            self._connection.type_of(address, self._connection.published)
            latched = not name.rpartition("/")[2].startswith(("measured_", "setpoint_"))
            topic = self._topics[name] = Topic(self._connection, address, model, latched=latched)
        return cast("M", topic.newest())

    def _topic(self, name: str) -> str:
        return f"/{self._events.arm}/{self._part}{name}"


class JointGroup(Operations):
    """Joints commanded together: those of an arm, or its jaw."""

    def measured_js(self) -> Joints:
        """Return measured positions (rad, m), velocities and efforts, each of shape (n,)."""
        return Joints.from_message(self._read("measured_js", JointState))

    def setpoint_js(self) -> Joints:
        """Return commanded positions (rad, m), velocities and efforts, each of shape (n,)."""
        return Joints.from_message(self._read("setpoint_js", JointState))

    def servo_jp(self, position: ArrayLike, velocity: ArrayLike | None = None) -> None:
        """Follow joint positions, shape (n,), rad or m: a command of a stream, without a trajectory.

        Raises MotionError if the arm has refused an earlier command of the stream.

        Args:
            position: goal.
            velocity: velocity at the goal, shape (n,); None: not stated.
        """
        rates = None if velocity is None else self._values("servo_jp", velocity)
        self.send("servo_jp", _joints(self._values("servo_jp", position), velocity=rates))

    def servo_jf(self, effort: ArrayLike) -> None:
        """Apply joint efforts, shape (n,), N m or N; errors as of `servo_jp`."""
        self.send("servo_jf", JointState(header=_header(), effort=self._values("servo_jf", effort)))

    def move_jp(self, position: ArrayLike) -> Handle:
        """Move to joint positions, shape (n,), rad or m, along a trajectory; returns at once.

        `move_jp(q).wait()` blocks until the arm is there.
        """
        return self._move("move_jp", _joints(self._values("move_jp", position)))

    def _move(self, name: str, message: Message) -> Handle:
        command = self._part + name
        self._events.take_refusal(command)
        move = Move(self._events, command)
        self.send(name, message)
        return move

    def _values(self, command: str, values: ArrayLike) -> Vector:
        """Return the values as vector. Raises MotionError for anything but finite numbers in a row."""
        vector = np.asarray(values, np.float64)
        if vector.ndim != 1 or not np.isfinite(vector).all():
            raise MotionError(
                f"{self._events.arm}: {self._part}{command} needs a row of finite numbers, not"
                f" {np.asarray(values).tolist()}"
            )
        return vector


class Tip(Operations):
    """States and wrench of the tip in another frame: `local`, `body` or `spatial`.

    `local` is the arm's base frame; `body` the tip's; `spatial` the base frame at its origin.
    """

    def measured_cp(self) -> Pose:
        """Return the measured pose of the tip; `local` only."""
        return Pose.from_message(self._read("measured_cp", PoseStamped))

    def setpoint_cp(self) -> Pose:
        """Return the commanded pose of the tip; `local` only."""
        return Pose.from_message(self._read("setpoint_cp", PoseStamped))

    def measured_cv(self) -> Twist:
        """Return the measured velocity of the tip; `local` only."""
        return Twist.from_message(self._read("measured_cv", TwistStamped))

    def measured_cf(self) -> Wrench:
        """Return the wrench that balances the joint efforts; `body` and `spatial` only."""
        return Wrench.from_message(self._read("measured_cf", WrenchStamped))

    def servo_cf(self, force: ArrayLike, torque: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        """Apply a wrench: force (N) and torque (N m), each of shape (3,); `body` and `spatial` only."""
        wrench = WrenchMessage(force=_vector3(force), torque=_vector3(torque))
        self.send("servo_cf", WrenchStamped(header=_header(), wrench=wrench))


class Arm(JointGroup):
    """An arm of a session: PSM1, PSM2, PSM3 or ECM."""

    def __init__(self, connection: Connection, name: str) -> None:
        self.name = name
        """Name of the arm."""
        super().__init__(connection, ArmEvents(connection, name))
        self.local = Tip(connection, self._events, "local/")
        """The tip in the arm's base frame."""
        self.body = Tip(connection, self._events, "body/")
        """Wrenches in the frame of the tip."""
        self.spatial = Tip(connection, self._events, "spatial/")
        """Wrenches in the arm's base frame, at its origin."""
        self._jaw: JointGroup | None = None

    @property
    def jaw(self) -> JointGroup:
        """The jaw, a group of one joint (rad). Raises ConnectError for an arm without a jaw."""
        if self._jaw is None:
            self._connection.type_of(f"/{self.name}/jaw/measured_js", self._connection.published)
            self._jaw = JointGroup(self._connection, self._events, "jaw/")
        return self._jaw

    def measured_cp(self) -> Pose:
        """Return the measured pose of the tip, m, in the reference frame (`Pose.frame`)."""
        return Pose.from_message(self._read("measured_cp", PoseStamped))

    def setpoint_cp(self) -> Pose:
        """Return the commanded pose of the tip, m, in the reference frame."""
        return Pose.from_message(self._read("setpoint_cp", PoseStamped))

    def measured_cv(self) -> Twist:
        """Return the measured velocity of the tip, m/s and rad/s, in the reference frame."""
        return Twist.from_message(self._read("measured_cv", TwistStamped))

    def servo_jr(self, displacement: ArrayLike) -> None:
        """Follow positions relative to the newest goal, shape (n,), rad or m; errors as of `servo_jp`."""
        self.send("servo_jr", _joints(self._values("servo_jr", displacement)))

    def servo_cp(self, pose: Pose | ArrayLike) -> None:
        """Follow a pose of the tip, m, in the frame of `measured_cp`: a command of a stream.

        Errors as of `servo_jp`.

        Args:
            pose: a `Pose`, or a homogeneous matrix, shape (4, 4).
        """
        self.send("servo_cp", _pose(pose))

    def move_jr(self, displacement: ArrayLike) -> Handle:
        """Move by joint displacements, shape (n,), rad or m, from the present goal."""
        return self._move("move_jr", _joints(self._values("move_jr", displacement)))

    def move_cp(self, pose: Pose | ArrayLike) -> Handle:
        """Move the tip to a pose, m, in the frame of `measured_cp`; `pose` as of `servo_cp`."""
        return self._move("move_cp", _pose(pose))

    def hold(self) -> None:
        """Brake and stay. Every program may send this command to every arm."""
        self.send("hold", EmptyMessage())

    def free(self) -> None:
        """Apply no effort but gravity compensation."""
        self.send("free", EmptyMessage())

    def operating_state(self) -> OperatingState:
        """Return the newest operating state: `state`, `is_homed`, `is_busy`."""
        return self._events.state

    def state_command(self, command: str) -> Handle:
        """Change the operating state: `enable`, `disable`, `home`, `unhome`, `pause` or `resume`."""
        change = StateChange(self._events, command, _STATES.get(command, _never))
        # without a stamp: a slow clock of this machine must not make the command look old
        self.send("state_command", StringStamped(string=command))
        return change

    def enable(self) -> Handle:
        """Switch the drives on."""
        return self.state_command("enable")

    def disable(self) -> Handle:
        """Switch the drives off."""
        return self.state_command("disable")

    def home(self) -> Handle:
        """Switch the drives on if necessary, and move home unless homed."""
        return self.state_command("home")

    def set_trajectory_ratio(self, ratio: float) -> None:
        """Set the fraction of the limits of velocity and acceleration for the next moves, above 0, up to 1.

        CRTK's `trajectory_j/set_ratio`.
        """
        self.send("trajectory_j/set_ratio", Float64Message(data=ratio))


def _never(_: OperatingState) -> bool:
    return False


def _header(frame: str = "") -> Header:
    return Header(stamp=Time.from_ns(time_ns()), frame_id=frame)


def _joints(position: Vector, velocity: Vector | None = None) -> JointState:
    rates = np.zeros(0) if velocity is None else velocity
    return JointState(header=_header(), position=position, velocity=rates)


def _numbers(values: ArrayLike, shape: Sequence[int]) -> Vector:
    """Return finite values of this shape. Raises MotionError for other values."""
    array = np.asarray(values, np.float64)
    if array.shape != tuple(shape) or not np.isfinite(array).all():
        raise MotionError(f"{np.asarray(values).tolist()}: expected finite numbers of shape {tuple(shape)}")
    return array


def _vector3(values: ArrayLike) -> Vector3:
    x, y, z = _numbers(values, (3,)).tolist()
    return Vector3(x=x, y=y, z=z)


def _pose(pose: Pose | ArrayLike) -> PoseStamped:
    stated = pose if isinstance(pose, Pose) else Pose.from_matrix(_numbers(pose, (4, 4)))
    x, y, z = _numbers(stated.position, (3,)).tolist()
    qx, qy, qz, qw = _numbers(stated.orientation, (4,)).tolist()
    return PoseStamped(
        header=_header(stated.frame),
        pose=PoseMessage(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw)),
    )
