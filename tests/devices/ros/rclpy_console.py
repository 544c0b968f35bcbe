"""A ROS 2 program on real rclpy, led by a test: to each line of JSON on its input, `{"do": ..., ...}`, it
says one on its output.

Run by the Python of `rclpy_environment`, which has nothing of ours. Its messages are nested dictionaries.
"""

import importlib
import json
import sys
import time

import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile


class Console:
    """A node with subscriptions, publishers and clients by topic.

    Messages are taken when asked for: an executor in Python is too slow for hundreds.
    """

    def __init__(self, name):
        rclpy.init()
        self.node = rclpy.create_node(name)
        self.asking = rclpy.create_node(f"{name}_asking")
        self.subscriptions, self.publishers, self.services = {}, {}, {}

    def join(self, rows, timeout):
        """Make what fits each of `rows`: topic, type, way and whether it is latched; return what has found no
        peer in time.
        """
        for topic, type_, way, latched in rows:
            cls = found(type_)
            if way == "publish":
                quality = QoSProfile(
                    depth=10,
                    durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
                )
                self.subscriptions[topic] = self.node.create_subscription(cls, topic, lambda _: None, quality)
            elif way == "subscribe":
                self.publishers[topic] = self.node.create_publisher(cls, topic, 10)
            else:
                self.services[topic] = self.asking.create_client(cls, topic), cls
        end = time.monotonic() + timeout
        while (lonely := self.lonely(topic for topic, *_ in rows)) and time.monotonic() < end:
            time.sleep(0.02)
        return lonely

    def lonely(self, topics):
        subscriptions = {topic: it.get_publisher_count() for topic, it in self.subscriptions.items()}
        publishers = {topic: it.get_subscription_count() for topic, it in self.publishers.items()}
        services = {topic: it.service_is_ready() for topic, (it, _) in self.services.items()}
        return [topic for topic in topics if not (subscriptions | publishers | services)[topic]]

    def send(self, topic, message, times=1):
        publisher = self.publishers[topic]
        ready = filled(publisher.msg_type(), message)
        for _ in range(times):
            publisher.publish(ready)

    def send_raw(self, topic, payload):
        """Publish bytes, given in hexadecimal, as they are."""
        self.publishers[topic].publish(bytes.fromhex(payload))

    def heard(self, topic, timeout):
        """Return the next message that was not returned before; None if none comes in time."""
        subscription, end = self.subscriptions[topic], time.monotonic() + timeout
        while True:
            taken = subscription.handle.take_message(subscription.msg_type, False)
            if taken is not None:
                return flat(taken[0])
            if time.monotonic() > end:
                return None
            time.sleep(0.002)

    def call(self, topic, request, timeout):
        client, cls = self.services[topic]
        future = client.call_async(filled(cls.Request(), request))
        rclpy.spin_until_future_complete(self.asking, future, timeout_sec=timeout)
        return flat(future.result()) if future.done() else None

    def nodes(self):
        return [
            f"{namespace.rstrip('/')}/{name}" for name, namespace in self.node.get_node_names_and_namespaces()
        ]

    def offered(self, topic):
        """Return node, type, hash, durability and reliability of all publishers and subscriptions."""
        there = self.node.get_publishers_info_by_topic(topic) + self.node.get_subscriptions_info_by_topic(
            topic
        )
        return [
            (
                it.node_name,
                it.topic_type,
                str(it.topic_type_hash),
                it.qos_profile.durability.name,
                it.qos_profile.reliability.name,
            )
            for it in there
        ]


def found(type_):
    package, group, name = type_.split("/")
    return getattr(importlib.import_module(f"{package}.{group}"), name)


def filled(message, content):
    """Fill a message from nested dictionaries."""
    kinds = message.get_fields_and_field_types()
    for name, value in content.items():
        if isinstance(value, dict):
            filled(getattr(message, name), value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            kind = found(kinds[name].removeprefix("sequence<").removesuffix(">").replace("/", "/msg/"))
            setattr(message, name, [filled(kind(), each) for each in value])
        else:
            setattr(message, name, value)
    return message


def flat(value):
    """Return a message as nested dictionaries and lists."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: flat(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, bytes):  # a `byte`
        return value[0]
    return [flat(one) for one in value] if isinstance(value, list | tuple) else value


def main(name):
    console = Console(name)
    for line in sys.stdin:
        order = json.loads(line)
        answer = getattr(console, order.pop("do"))(**order)
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()
    for node in (console.node, console.asking):  # at the end of the process alone, nobody is told
        node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main(*sys.argv[1:])
