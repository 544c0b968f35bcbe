"""The ROS graph on DDS: endpoints of participants, and names of their nodes from `ros_discovery_info`.

Source: ros2/rmw_dds_common, README and msg/ParticipantEntitiesInfo.msg.
"""

from __future__ import annotations

import struct
import threading
from collections.abc import Collection, Sequence
from typing import Any

from devices.ros.transport import Client
from schemas.codec import typestore
from schemas.errors import MessageError

__all__ = ["INFO_TOPIC", "INFO_TYPE", "Graph", "entities_info"]

INFO_TOPIC, INFO_TYPE = "ros_discovery_info", "rmw_dds_common/msg/ParticipantEntitiesInfo"

_CDR_LE = b"\x00\x01\x00\x00"

_MOST_NAMES = 1000
"""Most senders with a kept name, gone senders included."""


def entities_info(participant: bytes, node: str, readers: Sequence[bytes], writers: Sequence[bytes]) -> bytes:
    """Return the message (CDR) for the assignment of all readers and writers of a participant to a node.

    Encoded again for each of some hundred endpoints, hence not by the codec.

    Args:
        participant: GUID of the participant, 16 bytes.
        node: name of the node with namespace.
        readers: GUIDs of the readers.
        writers: GUIDs of the writers.
    """
    namespace, _, name = node.rpartition("/")
    body = participant + struct.pack("<I", 1)
    for text in (namespace or "/", name):
        body += b"\x00" * (-len(body) % 4) + struct.pack("<I", len(text) + 1) + text.encode() + b"\x00"
    body += b"\x00" * (-len(body) % 4)
    return (
        _CDR_LE
        + body
        + b"".join(struct.pack("<I", len(guids)) + b"".join(guids) for guids in (readers, writers))
    )


class Graph:
    """All participants of the domain but our own; for use from any thread.

    A program is a participant with the name of the participant's first node. All GUIDs have 16 bytes.
    """

    def __init__(self, own: bytes) -> None:
        """`own`: GUID of our participant, ignored here."""
        self._own = own
        self._changing = threading.Lock()
        self._endpoints: dict[bytes, tuple[bytes, str]] = {}
        """Participant and DDS topic by endpoint."""
        self._reads: dict[bytes, str] = {}
        """DDS topic by endpoint, of readers."""
        self.read_topics: frozenset[str] = frozenset()
        """DDS topics read by programs."""
        self._nodes: dict[bytes, str] = {}
        """First node by participant."""
        self._names: dict[bytes, str] = {}
        """Names of participants, fixed from the first message on."""

    def add_endpoint(
        self, endpoint: bytes, participant: bytes, topic: str, *, is_reader: bool = False
    ) -> None:
        """Add a reader or a writer."""
        if participant != self._own:
            with self._changing:
                self._endpoints[endpoint] = participant, topic
                if is_reader:
                    self._reads[endpoint] = topic
                    self.read_topics |= {topic}

    def remove_endpoint(self, endpoint: bytes) -> None:
        """Remove a reader or a writer, and with a participant's last endpoint the participant's nodes.

        The participant's name is kept: on a busy machine a program counts as gone for a while, and goes on.
        """
        with self._changing:
            participant, _ = self._endpoints.pop(endpoint, (b"", ""))
            if self._reads.pop(endpoint, None) is not None:
                self.read_topics = frozenset(self._reads.values())
            if participant not in self._present():
                self._nodes.pop(participant, None)

    def set_nodes(self, info: bytes) -> None:
        """Set the nodes of a participant from a ParticipantEntitiesInfo (CDR).

        Raises MessageError for other bytes.
        """
        try:
            message: Any = typestore().deserialize_cdr(info, INFO_TYPE)
        except Exception as error:  # rosbags lets struct.error, IndexError, AssertionError and more through
            raise MessageError(
                f"{INFO_TYPE}: {len(info)} bytes are no such message ({type(error).__name__}: {error})"
            ) from error
        participant = bytes(message.gid.data)
        if participant != self._own and message.node_entities_info_seq:
            first = message.node_entities_info_seq[0]
            with self._changing:
                self._nodes[participant] = f"{first.node_namespace.rstrip('/')}/{first.node_name}"

    def sender(self, participant: bytes) -> str:
        """Return the name of a participant, and keep the name from now on.

        A program in command of an arm thus stays the same program when the node's name is discovered.
        """
        with self._changing:
            if participant not in self._names:
                self._names[participant] = self._name(participant)
                if len(self._names) > _MOST_NAMES:
                    del self._names[next(iter(self._names))]
            return self._names[participant]

    def _name(self, participant: bytes) -> str:
        """Return the name of a participant's first node, with the id if the name is not unique."""
        identity, node = participant[:12].hex(), self._nodes.get(participant)
        if node is None:
            return f"participant {identity}"
        others = self._present() - {participant}
        return f"{node} ({identity})" if any(self._names.get(other) == node for other in others) else node

    def _present(self) -> set[bytes]:
        return {participant for participant, _ in self._endpoints.values()}

    def clients(self, topics: Collection[str]) -> tuple[Client, ...]:
        """Return the programs reading or writing any of the DDS topics `topics`."""
        with self._changing:
            found = dict.fromkeys(
                participant for participant, topic in self._endpoints.values() if topic in topics
            )
            return tuple(
                Client(self._names.get(participant) or self._name(participant), participant[:12].hex())
                for participant in found
            )
