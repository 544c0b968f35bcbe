"""Who is in a ROS graph on DDS: what participants write and read, as DDS tells, and how their nodes are
called, as they tell on `ros_discovery_info`.

Source: ros2/rmw_dds_common, its README and msg/ParticipantEntitiesInfo.msg.
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


def entities_info(participant: bytes, node: str, readers: Sequence[bytes], writers: Sequence[bytes]) -> bytes:
    """Return the message (CDR) in which a participant tells that all its readers and writers, given by their
    ids of 16 bytes, are those of `node`.

    It is made for each of some hundred of them: hence not by the codec.
    """
    namespace, _, name = node.rpartition("/")
    body = participant + struct.pack("<I", 1)
    for text in (namespace or "/", name):
        body += b"\x00" * (-len(body) % 4) + struct.pack("<I", len(text) + 1) + text.encode() + b"\x00"
    body += b"\x00" * (-len(body) % 4)
    return (
        _CDR_LE + body + b"".join(struct.pack("<I", len(ids)) + b"".join(ids) for ids in (readers, writers))
    )


class Graph:
    """The other participants.

    A program is a participant, and is called like its first node; may be used from any thread.
    """

    def __init__(self, own: bytes) -> None:
        """`own`: the id of the participant that is not looked at."""
        self._own = own
        self._changing = threading.Lock()
        self._endpoints: dict[bytes, tuple[bytes, str]] = {}
        """Participant and topic of DDS by endpoint, all ids with 16 bytes."""
        self._nodes: dict[bytes, str] = {}
        """First node by participant, as told."""
        self._names: dict[bytes, str] = {}
        """What a participant is called since it sent something."""

    def came(self, endpoint: bytes, participant: bytes, topic: str) -> None:
        """Take note of a reader or a writer."""
        if participant != self._own:
            with self._changing:
                self._endpoints[endpoint] = participant, topic

    def went(self, endpoint: bytes) -> None:
        """Forget a reader or a writer, and its participant with the last one."""
        with self._changing:
            participant, _ = self._endpoints.pop(endpoint, (b"", ""))
            if all(other != participant for other, _ in self._endpoints.values()):
                self._nodes.pop(participant, None)
                self._names.pop(participant, None)

    def told(self, info: bytes) -> None:
        """Take what a participant tells of its nodes (CDR).

        Raises MessageError if the bytes are no such message.
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
        """Return what the program of a participant is called, from now on: who commands an arm does not
        become another one when its name is known.
        """
        with self._changing:
            return self._names.setdefault(participant, self._name(participant))

    def _name(self, participant: bytes) -> str:
        """Like its first node, with its id behind it if another one is called so."""
        identity, node = participant[:12].hex(), self._nodes.get(participant)
        if node is None:
            return f"participant {identity}"
        return (
            f"{node} ({identity})"
            if any(name == node for other, name in self._names.items() if other != participant)
            else node
        )

    def clients(self, topics: Collection[str]) -> tuple[Client, ...]:
        """Return the programs that have to do with any of `topics`, given as DDS calls them."""
        with self._changing:
            there = dict.fromkeys(
                participant for participant, topic in self._endpoints.values() if topic in topics
            )
            return tuple(
                Client(self._names.get(participant) or self._name(participant), participant[:12].hex())
                for participant in there
            )
