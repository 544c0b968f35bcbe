"""The client of each middleware for the console of `bench/ros.py`, on libraries of others.

They share no code with the gateways.

Each runs in the Python that has its library, so nothing but the standard library is imported up here. A
message is as the library has it; `Take` gets it with its number on its topic, None where the middleware tells
none.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib import import_module
from threading import Event, Thread
from typing import Any

__all__ = ["JOINT_STATE", "MIDDLEWARE", "OPERATING_STATE", "STRING_STAMPED"]

Take = Callable[[Any, "int | None"], None]
JOINT_STATE, OPERATING_STATE, STRING_STAMPED = (
    "sensor_msgs/msg/JointState",
    "crtk_msgs/msg/OperatingState",
    "crtk_msgs/msg/StringStamped",
)
PATIENCE_S, POLL_S = 20.0, 5e-4


class Zenoh:
    """The program of the tests, written from rmw_zenoh's design on eclipse-zenoh and rosbags.

    `where`: the router's endpoint.
    """

    def __init__(self, where: str) -> None:
        from tests.devices.ros.zenoh import zenoh_peer

        self._types = zenoh_peer.TYPES.types
        self._peer = zenoh_peer.Peer(where, "figures")
        self._publish: dict[str, Callable[..., None]] = {}

    def listen(self, topic: str, type_: str, take: Take, *, latched: bool = False) -> None:
        self._peer.listen(topic, type_, lambda message, attached: take(message, attached[0]), latched=latched)

    def start(self) -> None:
        """Messages are taken as they come."""

    def advertise(self, topic: str, type_: str) -> None:
        self._publish[topic] = self._peer.publisher(topic, type_)

    def joints(self, topic: str, positions: list[float]) -> int:
        """Publish positions; return their stamp (ns)."""
        import numpy as np

        stamp_ns, nothing = time.time_ns(), np.zeros(0)
        header = self._header(stamp_ns)
        self._publish[topic](
            self._types[JOINT_STATE](
                header=header, name=[], position=np.array(positions), velocity=nothing, effort=nothing
            )
        )
        return stamp_ns

    def words(self, topic: str, text: str) -> int:
        """Publish a stamped string; return its stamp (ns)."""
        stamp_ns = time.time_ns()
        self._publish[topic](self._types[STRING_STAMPED](header=self._header(stamp_ns), string=text))
        return stamp_ns

    def _header(self, stamp_ns: int) -> Any:
        sec, nanosec = divmod(stamp_ns, 10**9)
        return self._types["std_msgs/msg/Header"](
            stamp=self._types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec), frame_id=""
        )

    @staticmethod
    def stamp_ns(message: Any) -> int:
        return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec

    def close(self) -> None:
        self._peer.close()


class Rclpy:
    """A node on rclpy, whose domain is in the environment.

    Its messages are taken one after the other: the executor in Python is too slow for so many.
    """

    def __init__(self, where: str) -> None:
        import rclpy

        rclpy.init()
        self._rclpy, self._node, self._publishers, self._takers = rclpy, rclpy.create_node("figures"), {}, []
        self._ending = Event()
        self._thread = Thread(target=self._run, daemon=True)

    def listen(self, topic: str, type_: str, take: Take, *, latched: bool = False) -> None:
        from rclpy.qos import DurabilityPolicy, QoSProfile

        durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
        subscription = self._node.create_subscription(
            self._found(type_), topic, lambda _: None, QoSProfile(depth=10, durability=durability)
        )
        self._takers.append((subscription, take))
        _wait(lambda: self._node.count_publishers(topic))

    def start(self) -> None:
        """Begin to take messages."""
        self._thread.start()

    def _run(self) -> None:
        while not self._ending.wait(POLL_S):
            for subscription, take in self._takers:
                while (taken := subscription.handle.take_message(subscription.msg_type, False)) is not None:
                    take(taken[0], taken[1]["publication_sequence_number"])

    def advertise(self, topic: str, type_: str) -> None:
        publisher = self._publishers[topic] = self._node.create_publisher(self._found(type_), topic, 10)
        _wait(lambda: publisher.get_subscription_count())

    def joints(self, topic: str, positions: list[float]) -> int:
        """Publish positions; return their stamp (ns)."""
        message = self._found(JOINT_STATE)()
        message.position = positions
        return self._send(topic, message)

    def words(self, topic: str, text: str) -> int:
        """Publish a stamped string; return its stamp (ns)."""
        message = self._found(STRING_STAMPED)()
        message.string = text
        return self._send(topic, message)

    def _send(self, topic: str, message: Any) -> int:
        stamp_ns = time.time_ns()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
        self._publishers[topic].publish(message)
        return stamp_ns

    @staticmethod
    def _found(type_: str) -> Any:
        package, kind, name = type_.split("/")
        return getattr(import_module(f"{package}.{kind}"), name)

    stamp_ns = staticmethod(Zenoh.stamp_ns)

    def close(self) -> None:
        self._ending.set()
        self._thread.join(PATIENCE_S)
        self._rclpy.shutdown()


class Rospy:
    """A node on rospy; its master is in the environment."""

    def __init__(self, where: str) -> None:
        import rospy

        from tests.devices.ros.rospy_console import message_class

        rospy.init_node("figures", disable_signals=True, disable_rosout=True)
        self._rospy, self._class, self._publishers = rospy, message_class, {}

    def listen(self, topic: str, type_: str, take: Take, *, latched: bool = False) -> None:
        picture = 2**20  # bytes at once: with less a picture is put together from many reads
        heard = self._rospy.Subscriber(
            topic,
            self._class(type_),
            lambda message: take(message, message.header.seq),
            queue_size=10,
            buff_size=picture,
            tcp_nodelay=True,
        )
        _wait(heard.get_num_connections)

    start = Zenoh.start

    def advertise(self, topic: str, type_: str) -> None:
        publisher = self._publishers[topic] = self._rospy.Publisher(
            topic, self._class(type_), queue_size=10, tcp_nodelay=True
        )
        _wait(publisher.get_num_connections)

    def joints(self, topic: str, positions: list[float]) -> int:
        """Publish positions; return their stamp (ns)."""
        message = self._class(JOINT_STATE)()
        message.position = positions
        return self._send(topic, message)

    def words(self, topic: str, text: str) -> int:
        """Publish a stamped string; return its stamp (ns)."""
        message = self._class(STRING_STAMPED)()
        message.string = text
        return self._send(topic, message)

    def _send(self, topic: str, message: Any) -> int:
        stamp_ns = time.time_ns()
        message.header.stamp = self._rospy.Time(*divmod(stamp_ns, 10**9))
        self._publishers[topic].publish(message)
        return stamp_ns

    @staticmethod
    def stamp_ns(message: Any) -> int:
        return message.header.stamp.to_nsec()

    def close(self) -> None:
        self._rospy.signal_shutdown("done")


def _wait(peers: Callable[[], int]) -> None:
    """Wait for a peer, as a CRTK client does before it begins."""
    until = time.monotonic() + PATIENCE_S
    while not peers() and time.monotonic() < until:
        time.sleep(0.01)


MIDDLEWARE = {"ros2-zenoh": Zenoh, "ros2-dds": Rclpy, "ros1": Rospy}
"""What speaks to the gateway of a kind."""
