"""Samples of devices: made from plain numbers, stamped, played from a recording, and when they are due."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np

from devices.vendor_axes import Quaternion, Vector3
from hub.participant import Sample
from schemas.message import Message
from schemas.ports import Port
from schemas.ros import Header, Joy, Point, Pose, PoseStamped, Time, Twist, TwistStamped
from schemas.ros import Quaternion as QuaternionMessage
from schemas.ros import Vector3 as Vector3Message

__all__ = [
    "Clock",
    "Playback",
    "SampleTimer",
    "button_sample",
    "clock_of",
    "pose_sample",
    "stamp_message",
    "stamp_of",
    "twist_sample",
]

Clock = Literal["simulated", "wall"]

_RETRY_NS = 1_000_000_000
"""A missing device is looked for once a second: to start a runtime or to log in takes seconds."""


def clock_of(*, simulated_time: bool) -> Clock:
    """Return the clock of a device's ports."""
    return "simulated" if simulated_time else "wall"


def pose_sample(port: Port, time_ns: int, position: Vector3, orientation: Quaternion) -> Sample:
    """Return a pose, m and quaternion (x, y, z, w), in the port's frame at `time_ns` of the port's clock."""
    (x, y, z), (qx, qy, qz, qw) = position, orientation
    pose = Pose(position=Point(x=x, y=y, z=z), orientation=QuaternionMessage(x=qx, y=qy, z=qz, w=qw))
    return Sample(port.name, PoseStamped(header=_header(port, time_ns), pose=pose))


def twist_sample(port: Port, time_ns: int, linear: Vector3, angular: Vector3) -> Sample:
    """Return the velocity (m/s) of a frame's origin and its angular velocity (rad/s).

    Both are along the axes of the port's frame, at `time_ns` of the port's clock.
    """
    (vx, vy, vz), (wx, wy, wz) = linear, angular
    twist = Twist(linear=Vector3Message(x=vx, y=vy, z=vz), angular=Vector3Message(x=wx, y=wy, z=wz))
    return Sample(port.name, TwistStamped(header=_header(port, time_ns), twist=twist))


def button_sample(port: Port, time_ns: int, pressed: Sequence[bool]) -> Sample:
    """Return the buttons of a hand-held device."""
    return Sample(port.name, Joy(header=_header(port, time_ns), buttons=np.array(pressed, np.int32)))


def _header(port: Port, time_ns: int) -> Header:
    return Header(stamp=Time.from_ns(time_ns), frame_id=port.frame)


def stamp_message(message: Message, stamp_ns: int) -> Message:
    """Return `message` with this stamp; unchanged if its type has none."""
    header = getattr(message, "header", None)
    if not isinstance(header, Header):
        return message
    return message.model_copy(update={"header": header.model_copy(update={"stamp": Time.from_ns(stamp_ns)})})


def stamp_of(message: Message) -> int | None:
    """Return the stamp (ns) of a message; None if its type has none."""
    header = getattr(message, "header", None)
    return header.stamp.ns if isinstance(header, Header) else None


class Playback:
    """Returns each recorded sample once, when its time has come."""

    def __init__(self, samples: Iterable[tuple[int, Sample]] = ()) -> None:
        """`samples`: time (ns) and sample, oldest first; the iterable may be endless."""
        self._samples = iter(samples)
        self._next = next(self._samples, None)

    def due(self, t: int) -> list[Sample]:
        """Return the samples up to time `t` (ns) not returned before, oldest first."""
        due: list[Sample] = []
        while self._next is not None and self._next[0] <= t:
            due.append(self._next[1])
            self._next = next(self._samples, None)
        return due


class SampleTimer:
    """When a device is to be sampled: at most `rate` times a second, and once a second while it fails."""

    def __init__(self, rate: float) -> None:
        """`rate`: Hz."""
        self._period_ns, self._due_ns = round(1e9 / rate), 0

    def due(self, t: int) -> bool:
        """Return whether a sample is due at `t` (ns), and count it as taken if so."""
        if t < self._due_ns:
            return False
        self._due_ns = max(self._due_ns + self._period_ns, t)
        return True

    def failed(self, t: int) -> None:
        """Wait for a second from `t` (ns) on before the next try."""
        self._due_ns = t + _RETRY_NS
