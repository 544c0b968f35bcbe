"""The layout of ROS 2 on Zenoh: keys of topics and services, liveliness tokens, and attachments of messages.

The layout of rmw_zenoh in Jazzy. Source: ros2/rmw_zenoh, docs/design.md, and for open questions
rmw_zenoh_cpp/src/detail/liveliness_utils.cpp (commit 3411fdec), attachment_helpers.cpp and
rmw_publisher_data.cpp (commit 3e19ec73).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Literal

from devices.ros.zenoh.service_hash import service_hash
from schemas.codec import message_type, rihs01
from schemas.errors import MessageError
from schemas.message import msg_text

__all__ = [
    "LATCHED",
    "VOLATILE",
    "Attachment",
    "EntityKind",
    "GraphToken",
    "graph_key",
    "key",
    "packed_attachment",
    "ready_key",
    "type_hash",
]

EntityKind = Literal["NN", "MP", "MS", "SS", "SC"]
"""Node, publisher, subscriber, server and client of a service."""

_ATTACHMENT = struct.Struct("<qqB16s")
_GID_BYTES = 16

VOLATILE = "::,10:,:,:,,"
"""Quality of service, encoded by the differences from the default: the last ten messages."""

LATCHED = ":1:,1:,:,:,,"
"""Transient local, the last message."""


def key(domain: int, topic: str, type_: str) -> str:
    """Return the key of a topic or a service (`/PSM1/measured_js`) of ROS type `type_`."""
    return f"{domain}/{topic.strip('/')}/{_dds_name(type_)}/{type_hash(type_)}"


def graph_key(domain: int) -> str:
    """Return the key expression of all tokens."""
    return f"@ros2_lv/{domain}/**"


def ready_key(domain: int, session: str = "*", entities: int | None = None) -> str:
    """Return the key of our own token of a complete gateway; by default the expression of all such keys.

    Args:
        domain: the ROS domain.
        session: Zenoh's id of the gateway's session.
        entities: number of the gateway's publishers, subscribers and servers.
    """
    return f"{domain}/trocar/gateway/{session}/{'*' if entities is None else entities}"


def type_hash(type_: str) -> str:
    """Return the hash (REP-2016) of a message or a service."""
    if "/srv/" not in type_:
        return rihs01(type_)
    return service_hash(
        type_, *(msg_text(message_type(f"{type_}_{part}")) for part in ("Request", "Response"))
    )


def _dds_name(type_: str) -> str:
    """`sensor_msgs/msg/JointState` to `sensor_msgs::msg::dds_::JointState_`."""
    package, group, name = type_.split("/")
    return f"{package}::{group}::dds_::{name}_"


def _mangle_name(name: str) -> str:
    return name.replace("/", "%") or "%"


@dataclass(frozen=True, slots=True)
class GraphToken:
    """A liveliness token of an entity in the ROS graph: a node, publisher, subscriber, server or client."""

    session: str
    """Zenoh's id of the program's session."""
    number: int
    """Number of the entity within the session."""
    kind: EntityKind
    node: str
    """Name of the node with namespace: `/dvrk`."""
    topic: str = ""
    """Name of the topic or service; empty for a node."""
    type: str = ""
    hash: str = ""
    quality: str = ""

    def key(self, domain: int) -> str:
        """Return the key of the token."""
        namespace, _, name = self.node.rpartition("/")
        parts = [
            "@ros2_lv",
            str(domain),
            self.session,
            "0",
            str(self.number),
            self.kind,
            "%",
            _mangle_name(namespace),
            name,
        ]
        if self.kind != "NN":
            parts += [_mangle_name(self.topic), _dds_name(self.type), self.hash, self.quality]
        return "/".join(parts)

    @classmethod
    def parse_token(cls, key: str) -> GraphToken | None:
        """Return the token with this key; None: a key of unknown form."""
        parts = key.split("/")
        if (
            len(parts) not in (9, 13)
            or parts[5] not in ("NN", "MP", "MS", "SS", "SC")
            or not parts[4].isdecimal()
        ):
            return None
        topic, type_, hash_, quality = (
            (parts[9].replace("%", "/"), *parts[10:]) if len(parts) > 9 else ("", "", "", "")
        )
        return cls(
            parts[2],
            int(parts[4]),
            parts[5],
            f"{parts[7].replace('%', '/').rstrip('/')}/{parts[8]}",
            topic,
            type_,
            hash_,
            quality,
        )


def packed_attachment(sequence: int, stamp_ns: int, gid: bytes) -> bytes:
    """Return the 33 bytes of an `Attachment`, without making the object."""
    return _ATTACHMENT.pack(sequence, stamp_ns, _GID_BYTES, gid)


@dataclass(frozen=True, slots=True)
class Attachment:
    """Attachment of every message and request; a response returns the attachment of the request."""

    sequence: int
    stamp_ns: int
    """Time of sending, by the wall clock of the sender."""
    gid: bytes
    """Id of the sending publisher or client, 16 bytes."""

    def pack(self) -> bytes:
        """Return the attachment as 33 bytes."""
        return packed_attachment(self.sequence, self.stamp_ns, self.gid)

    @classmethod
    def unpack(cls, data: bytes) -> Attachment:
        """Return the attachment in `data`. Raises MessageError if the bytes are no attachment."""
        if len(data) != _ATTACHMENT.size or data[16] != _GID_BYTES:
            raise MessageError(
                f"{len(data)} bytes are no attachment of ROS 2 (allowed: sequence number, stamp and 16 bytes"
                f" of id, {_ATTACHMENT.size} in all)"
            )
        sequence, stamp_ns, _, gid = _ATTACHMENT.unpack(data)
        return cls(sequence, stamp_ns, gid)
