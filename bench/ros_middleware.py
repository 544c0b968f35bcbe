"""How the console of `bench/ros.py` speaks each middleware: with a client library of its own, and nothing of the gateways.

It runs in whatever environment has that library, so nothing but the standard library is imported up here.
"""

from __future__ import annotations

from collections.abc import Callable
from time import time_ns
from typing import Any

Take = Callable[[Any, "int | None"], None]
"""Gets a message as the library has it, and its number on its topic where the middleware tells one."""

JOINT_STATE, OPERATING_STATE, STRING_STAMPED = "sensor_msgs/msg/JointState", "crtk_msgs/msg/OperatingState", "crtk_msgs/msg/StringStamped"
PATIENCE_S = 20.0


class Zenoh:
    """The independent ROS 2 program on eclipse-zenoh and rosbags that the tests have; `where` is the router's endpoint."""

    def __init__(self, where: str) -> None:
        from tests.devices.ros import zenoh_peer

        self._types = zenoh_peer.TYPES.types
        self._peer = zenoh_peer.Peer(where, "figures")
        self._publish: dict[str, Callable[..., None]] = {}

    def listen(self, topic: str, type_: str, take: Take, *, latched: bool = False) -> None:
        self._peer.listen(topic, type_, lambda message, attached: take(message, attached[0]), latched=latched)

    def advertise(self, topic: str, type_: str) -> None:
        self._publish[topic] = self._peer.publisher(topic, type_)

    def joints(self, topic: str, positions: list[float]) -> int:
        """Publish positions; return their stamp (ns)."""
        import numpy as np

        stamp_ns, nothing = time_ns(), np.zeros(0)
        header = self._header(stamp_ns)
        self._publish[topic](self._types[JOINT_STATE](header=header, name=[], position=np.array(positions), velocity=nothing, effort=nothing))
        return stamp_ns

    def words(self, topic: str, text: str) -> int:
        """Publish a stamped string; return its stamp (ns)."""
        stamp_ns = time_ns()
        self._publish[topic](self._types[STRING_STAMPED](header=self._header(stamp_ns), string=text))
        return stamp_ns

    def _header(self, stamp_ns: int) -> Any:
        sec, nanosec = divmod(stamp_ns, 10**9)
        return self._types["std_msgs/msg/Header"](stamp=self._types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec), frame_id="")

    @staticmethod
    def stamp_ns(message: Any) -> int:
        return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec

    def close(self) -> None:
        self._peer.close()


MIDDLEWARE = {"ros2-zenoh": Zenoh}
"""What speaks to the gateway of a kind."""
