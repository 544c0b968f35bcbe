"""The ROS programs at the other side of a participant, as Cyclone DDS comes to know them."""

from __future__ import annotations

import logging
from collections.abc import Collection

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

from devices.ros.dds.arrivals import Arrivals
from devices.ros.dds.graph import INFO_TOPIC, INFO_TYPE, Graph
from devices.ros.dds.types import Payload, payload_type
from devices.ros.transport import Client
from schemas.errors import MessageError

__all__ = ["Programs"]

log = logging.getLogger(__name__)

_LAST_OF_EACH = Qos(
    Policy.Reliability.Reliable(0),
    Policy.Durability.TransientLocal,
    Policy.History.KeepAll,
    Policy.DataRepresentation(use_cdrv0_representation=True),
)


class Programs:
    """Keeps a graph."""

    def __init__(self, participant: DomainParticipant, arrivals: Arrivals) -> None:
        """Begin to watch the others, with what takes whatever arrives at `participant`."""
        self._graph = Graph(participant.guid.bytes)
        self._senders: dict[int, bytes] = {}
        """Participants by handle of a writer."""
        for topic in (BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription):
            arrivals.add(BuiltinDataReader(participant, topic), self._came_or_went)
        info = payload_type(INFO_TYPE)
        arrivals.add(DataReader(participant, Topic(participant, INFO_TOPIC, info), _LAST_OF_EACH), self._told)

    def _came_or_went(self, endpoint: DcpsEndpoint) -> None:
        handle, key = endpoint.sample_info.instance_handle, endpoint.key.bytes
        if endpoint.sample_info.instance_state == InstanceState.Alive:
            self._senders[handle] = endpoint.participant_key.bytes
            self._graph.came(key, endpoint.participant_key.bytes, endpoint.topic_name)
        else:
            self._senders.pop(handle, None)
            self._graph.went(key)

    def _told(self, sample: Payload | InvalidSample) -> None:
        if isinstance(sample, Payload):
            try:
                self._graph.told(sample.cdr)
            except MessageError as error:
                log.warning("what a program tells of its nodes is not heeded: %s", error)

    def sender(self, publication: int) -> str:
        """Return the name of the program whose writer has this handle."""
        participant = self._senders.get(publication)
        return f"writer {publication:x}" if participant is None else self._graph.sender(participant)

    def clients(self, topics: Collection[str]) -> tuple[Client, ...]:
        """Return the programs that read or write any of `topics`, given as DDS calls them."""
        return self._graph.clients(topics)
