"""Discovers the ROS programs of a domain: DDS's built-in topics and `ros_discovery_info` feed the graph."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection

from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
    DcpsEndpoint,
)
from cyclonedds.core import InstanceState, Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.internal import InvalidSample
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from devices.ros.dds.graph import INFO_TOPIC, INFO_TYPE, Graph
from devices.ros.dds.types import Payload, payload_type
from devices.ros.dds.waitset import ReaderWaitSet
from devices.ros.transport import Client
from schemas.errors import MessageError

__all__ = ["Discovery"]

log = logging.getLogger(__name__)

_LAST_OF_EACH = Qos(
    Policy.Reliability.Reliable(0),
    Policy.Durability.TransientLocal,
    Policy.History.KeepAll,
    Policy.DataRepresentation(use_cdrv0_representation=True),
)


class Discovery:
    """Keeps the graph of a participant's domain up to date."""

    def __init__(
        self, participant: DomainParticipant, waitset: ReaderWaitSet, changed: Callable[[], None]
    ) -> None:
        """Start, with readers of `participant` in `waitset`; `changed`: called when `is_read` may have."""
        self._graph, self._changed = Graph(participant.guid.bytes), changed
        for topic, take in (
            (BuiltinTopicDcpsPublication, self._on_endpoint),
            (BuiltinTopicDcpsSubscription, self._on_reader),
        ):
            waitset.add(BuiltinDataReader(participant, topic), take)
        info = payload_type(INFO_TYPE)
        waitset.add(
            DataReader(participant, Topic(participant, INFO_TOPIC, info), _LAST_OF_EACH), self._on_info
        )

    def _on_endpoint(self, endpoint: DcpsEndpoint, *, is_reader: bool = False) -> None:
        guid = endpoint.key.bytes
        if endpoint.sample_info.instance_state == InstanceState.Alive:
            participant, topic = endpoint.participant_key.bytes, endpoint.topic_name
            self._graph.add_endpoint(guid, participant, topic, is_reader=is_reader)
        else:
            self._graph.remove_endpoint(guid)

    def _on_reader(self, endpoint: DcpsEndpoint) -> None:
        self._on_endpoint(endpoint, is_reader=True)
        self._changed()

    def is_read(self, topic: str) -> bool:
        """Return whether a program reads a DDS topic."""
        return topic in self._graph.read_topics

    def _on_info(self, sample: Payload | InvalidSample) -> None:
        if isinstance(sample, Payload):
            try:
                self._graph.set_nodes(sample.cdr)
            except MessageError as error:
                log.warning("the node names of a program are ignored: %s", error)

    def sender(self, participant: bytes) -> str:
        """Return the name of the program with the participant of this GUID (16 bytes)."""
        return self._graph.sender(participant)

    def clients(self, topics: Collection[str]) -> tuple[Client, ...]:
        """Return the programs reading or writing any of the DDS topics `topics`."""
        return self._graph.clients(topics)
