"""Ports declared in a line each: signals and events, in and out.

    signal_in("master", PoseStamped, "pose of the hand", max_age_ns=100_000_000)
    signal_in("torque", unit="N*m", start=(0.0,))          # an array of one number
    tunable_in("gravity", 9.81, (0.0, 25.0), "along -z of the world", unit="m/s^2")
    signal_out("servo_jp", JointState, "command to the joints", names=("yaw", "pitch"))
    event_out("warning", StringMessage, "why the arm holds, and what to do")

A `Port` built in full is the same object; the helpers only state causality and variability.
"""

from __future__ import annotations

from typing import Literal, TypedDict, Unpack

from schemas.message import Message
from schemas.ports import Port
from schemas.ros import Float64MultiArray

__all__ = [
    "EventFields",
    "MessageType",
    "SignalFields",
    "event_in",
    "event_out",
    "signal_in",
    "signal_out",
    "tunable_in",
]

MessageType = type[Message] | str
"""A message class, or the ROS name of a message such as `geometry_msgs/msg/PoseStamped`."""


class EventFields(TypedDict, total=False):
    """Optional fields of an event port; `Port` documents each."""

    names: tuple[str, ...]
    unit: str
    frame: str
    clock: Literal["simulated", "wall"]


class SignalFields(EventFields, total=False):
    """Optional fields of a signal; `Port` documents each."""

    size: int
    shape: tuple[int, ...]
    fields: tuple[Literal["position", "velocity", "effort"], ...]
    period_ns: int
    start: tuple[float, ...] | None
    limits: tuple[float, float] | None
    max_age_ns: int


def signal_in(
    name: str, type_: MessageType = Float64MultiArray, description: str = "", **fields: Unpack[SignalFields]
) -> Port:
    """Return an input with a single value at a time."""
    return Port(name=name, causality="input", type=_ros_type(type_), description=description, **fields)


def tunable_in(name: str, start: float, limits: tuple[float, float], description: str, unit: str) -> Port:
    """Return a parameter that people may change within limits while the session runs; see `Tunables`."""
    return Port(
        name=name, causality="input", start=(start,), limits=limits, description=description, unit=unit
    )


def signal_out(
    name: str, type_: MessageType = Float64MultiArray, description: str = "", **fields: Unpack[SignalFields]
) -> Port:
    """Return an output with a single value at a time."""
    return Port(name=name, causality="output", type=_ros_type(type_), description=description, **fields)


def event_in(name: str, type_: MessageType, description: str = "", **fields: Unpack[EventFields]) -> Port:
    """Return an input with a queue of messages."""
    return Port(
        name=name,
        causality="input",
        type=_ros_type(type_),
        variability="event",
        description=description,
        **fields,
    )


def event_out(name: str, type_: MessageType, description: str = "", **fields: Unpack[EventFields]) -> Port:
    """Return an output with a queue of messages."""
    return Port(
        name=name,
        causality="output",
        type=_ros_type(type_),
        variability="event",
        description=description,
        **fields,
    )


def _ros_type(type_: MessageType) -> str:
    return type_ if isinstance(type_, str) else type_.ros_type
