"""ROS 2 over DDS, on Eclipse Cyclone DDS: the gateway is a participant, and needs no ROS.

Sources: names from ros2/design, articles/140_topic_and_service_name_mapping.md; user data from
ros2/rmw_dds_common, rmw_dds_common/src/qos.cpp (hash of a type) and ros2/rmw_cyclonedds,
rmw_cyclonedds_cpp/src/rmw_node.cpp (enclave of a participant).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic

from devices.ros.dds.discovery import Discovery
from devices.ros.dds.graph import INFO_TOPIC, INFO_TYPE, entities_info
from devices.ros.dds.services import ServiceParticipant
from devices.ros.dds.types import Payload, payload_type
from devices.ros.dds.waitset import ReaderWaitSet
from devices.ros.topics.row import Row
from devices.ros.transport import NODE, Client, MessageHandler, Publisher, ServiceHandler, Transport
from schemas.codec import rihs01

__all__ = ["DdsTransport"]

_ALWAYS = (Policy.Reliability.Reliable(0), Policy.DataRepresentation(use_cdrv0_representation=True))
"""Reliable within a writer's history; a writer never blocks for a reader (max_blocking_time 0 ns)."""

VOLATILE = Qos(*_ALWAYS, Policy.Durability.Volatile, Policy.History.KeepLast(10))
"""Default of ROS programs: the last ten messages."""
_LARGE = Qos(*_ALWAYS, Policy.Durability.Volatile, Policy.History.KeepLast(60))
"""Quality of pictures: the messages of a second at 60 Hz.

A message larger than a packet is sent in fragments. A reader of Fast DDS 2.14 with some fragments never
returns from the next take when a GAP declares the rest gone (docs/decisions/0030): so the writer keeps the
rest while a busy machine loses packets.
"""
_LAST = Policy.DurabilityService(0, Policy.History.KeepLast(1), -1, -1, -1)
LATCHED = Qos(*_ALWAYS, Policy.Durability.TransientLocal, Policy.History.KeepLast(1), _LAST)


class _Publisher:
    """The writer of a topic; `is_read`: returns whether a program reads the topic, None: perhaps later."""

    def __init__(
        self, writer: DataWriter[Payload], type_: type[Payload], is_read: Callable[[], bool] | None
    ) -> None:
        self._writer, self._type, self._is_read = writer, type_, is_read

    @property
    def wanted(self) -> bool:
        return self._is_read is None or self._is_read()

    def __call__(self, message: bytes) -> None:
        self._writer.write(self._type(message))


class DdsTransport(Transport):
    """Publishes, subscribes and serves as a node on a participant.

    Publishing never waits for a reader: each writer keeps the last messages for slow readers. Subscriptions
    are made by `ServiceParticipant`, in the thread of the service participant.
    """

    def __init__(self, domain: Domain, number: int, services: ServiceParticipant) -> None:
        """Join `domain` with the number `number`; `services`: a participant of the same domain."""
        self._domain, self._services = domain, services
        self.endpoint = f"ROS_DOMAIN_ID={number}"
        self._participant = DomainParticipant(number, Qos(Policy.Userdata(b"enclave=/;")))
        self._guid = self._participant.guid.bytes
        services.ignore(self._guid)
        services.joined = self.note_newcomer
        self._waitset = ReaderWaitSet(self._participant, "DDS discovery")
        self._discovery = Discovery(self._participant, self._waitset, lambda: self.changed())
        self._topics: set[str] = set()
        self._readers: list[bytes] = []
        """GUIDs of the readers of subscriptions."""
        self._writers: list[DataWriter[Payload]] = []
        self._served: list[tuple[bytes, bytes]] = []
        """GUIDs of the reader and the writer of each service."""
        self._info = self._writer(INFO_TOPIC, payload_type(INFO_TYPE), LATCHED)
        self._closed = False
        self._announce_node()

    def advertise(self, row: Row) -> Publisher:  # noqa: D102
        type_ = payload_type(row.type)
        quality = LATCHED if row.latched else _LARGE if row.is_picture else VOLATILE
        topic = f"rt{row.topic}"
        writer = self._writer(topic, type_, quality, row.type)
        self._writers.append(writer)
        self._announce_node()
        return _Publisher(writer, type_, None if row.latched else partial(self._discovery.is_read, topic))

    def subscribe(self, row: Row, receive: MessageHandler) -> None:  # noqa: D102
        def on_message(payload: bytes, participant: bytes) -> None:
            receive(payload, self._discovery.sender(participant))

        self._topics.add(f"rt{row.topic}")
        self._readers.append(
            self._services.subscribe(row.topic, row.type, _type_hash_data(row.type), on_message)
        )
        self._announce_node()

    def serve(self, row: Row, handle: ServiceHandler) -> None:  # noqa: D102
        self._topics |= {f"rq{row.topic}Request", f"rr{row.topic}Reply"}
        self._served.append(self._services.serve(row.topic, row.type, handle))
        self._announce_node()

    def clients(self) -> tuple[Client, ...]:  # noqa: D102
        return self._discovery.clients(self._topics)

    def close(self) -> None:  # noqa: D102
        if not self._closed:
            self._closed = True
            self._waitset.close()
            self._services.close()
            # deletes it now, with all its entities, and not with the last reference to one of them
            self._participant.__del__()
            del self._domain

    def _writer(
        self, topic: str, type_: type[Payload], quality: Qos, ros_type: str = ""
    ) -> DataWriter[Payload]:
        self._topics.add(topic)
        return DataWriter(
            self._participant, Topic(self._participant, topic, type_), quality + _type_hash_quality(ros_type)
        )

    def _announce_node(self) -> None:
        """Publish the node of our readers and writers."""
        readers = [*self._readers, *(reader for reader, _ in self._served)]
        writers = [*(writer.guid.bytes for writer in self._writers), *(writer for _, writer in self._served)]
        self._info.write(self._info.data_type(entities_info(self._guid, NODE, readers, writers)))


def _type_hash_quality(ros_type: str) -> Qos:
    return Qos(Policy.Userdata(_type_hash_data(ros_type).encode())) if ros_type else Qos()


def _type_hash_data(ros_type: str) -> str:
    """Return the user data with the hash (REP-2016) of a topic's type."""
    return f"typehash={rihs01(ros_type)};"
