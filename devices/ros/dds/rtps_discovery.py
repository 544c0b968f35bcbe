"""Discovery of RTPS: announcements of participants (SPDP) and endpoints (SEDP), as parameter lists.

Source: OMG DDSI-RTPS 2.5, 8.5.3 (SPDP), 8.5.4 (SEDP), 9.3.1 (EntityIds), 9.6.2.3 (ports), table 9.13
(parameter ids).
"""

from __future__ import annotations

import socket
import struct
from enum import IntEnum

from devices.ros.dds.rtps import PL_CDR_LE, Data, encode_parameters, encode_string, parse_parameters
from schemas.errors import MessageError

__all__ = [
    "LEASE_S",
    "MULTICAST_GROUP",
    "PARTICIPANT",
    "PUBLICATIONS_READER",
    "PUBLICATIONS_WRITER",
    "READER_NO_KEY",
    "SPDP_READER",
    "SPDP_WRITER",
    "SUBSCRIPTIONS_READER",
    "SUBSCRIPTIONS_WRITER",
    "WRITER_NO_KEY",
    "Pid",
    "announced_endpoint",
    "announced_participant",
    "disposed_endpoint_id",
    "endpoint_data",
    "is_disposed",
    "multicast_port",
    "participant_data",
    "participant_disposal",
    "unicast_ports",
]

PARTICIPANT = b"\x00\x00\x01\xc1"
SPDP_WRITER, SPDP_READER = b"\x00\x01\x00\xc2", b"\x00\x01\x00\xc7"
PUBLICATIONS_WRITER, PUBLICATIONS_READER = b"\x00\x00\x03\xc2", b"\x00\x00\x03\xc7"
SUBSCRIPTIONS_WRITER, SUBSCRIPTIONS_READER = b"\x00\x00\x04\xc2", b"\x00\x00\x04\xc7"
"""EntityIds: of a participant; of built-in endpoints of SPDP, and of SEDP (publications, subscriptions)."""
WRITER_NO_KEY, READER_NO_KEY = b"\x03", b"\x04"
"""Entity kinds (last byte of the EntityId) of user-defined endpoints of topics without key."""

LEASE_S = 20.0
"""Time of silence until a participant counts as gone, s."""
MULTICAST_GROUP = "239.255.0.1"
"""Where participants announce themselves."""
_PORT_BASE, _DOMAIN_GAIN, _FIRST_UNICAST, _PARTICIPANT_GAIN = 7400, 250, 10, 2
"""PB, DG, d1 and PG of the mapping of ports."""
_MOST_PARTICIPANTS = 32


class Pid(IntEnum):
    """Parameter ids."""

    PARTICIPANT_LEASE_DURATION = 0x02
    TOPIC_NAME = 0x05
    TYPE_NAME = 0x07
    DOMAIN_ID = 0x0F
    PROTOCOL_VERSION = 0x15
    VENDORID = 0x16
    RELIABILITY = 0x1A
    DURABILITY = 0x1D
    USER_DATA = 0x2C
    DEFAULT_UNICAST_LOCATOR = 0x31
    METATRAFFIC_UNICAST_LOCATOR = 0x32
    PARTICIPANT_GUID = 0x50
    BUILTIN_ENDPOINT_SET = 0x58
    ENDPOINT_GUID = 0x5A
    KEY_HASH = 0x70
    STATUS_INFO = 0x71
    RELATED_SAMPLE_IDENTITY = 0x83
    """DDS-RPC 1.0, 7.8.2."""
    RELATED_SAMPLE_IDENTITY_EPROSIMA = 0x800F
    """The same under eProsima's own number."""


_RELIABLE, _VOLATILE = struct.pack("<iiI", 2, 0, 100_000_000), struct.pack("<i", 0)
_DISPOSED_UNREGISTERED = b"\x00\x00\x00\x03"
"""StatusInfo: the instance is disposed of and unregistered."""
_SPDP_AND_SEDP = struct.pack("<I", 0b111111)
"""BuiltinEndpointSet: announcer and detector of participants, publications and subscriptions."""


def multicast_port(domain: int) -> int:
    """Return the UDP port of a domain for SPDP by multicast."""
    return _PORT_BASE + _DOMAIN_GAIN * domain


def unicast_ports(domain: int) -> range:
    """Return the UDP ports for unicast SPDP of up to 32 participants per machine in a domain."""
    first = multicast_port(domain) + _FIRST_UNICAST
    return range(first, first + _PARTICIPANT_GAIN * (_MOST_PARTICIPANTS + 1), _PARTICIPANT_GAIN)


def participant_data(guid_prefix: bytes, domain: int, host: str, port: int) -> bytes:
    """Return the SPDPdiscoveredParticipantData of a participant with a single receiving address."""
    locator = struct.pack("<iI12x4s", 1, port, socket.inet_aton(host))
    return PL_CDR_LE + encode_parameters(
        {
            Pid.PROTOCOL_VERSION: b"\x02\x03",
            Pid.VENDORID: guid_prefix[:2],
            Pid.PARTICIPANT_GUID: guid_prefix + PARTICIPANT,
            Pid.DOMAIN_ID: struct.pack("<I", domain),
            Pid.BUILTIN_ENDPOINT_SET: _SPDP_AND_SEDP,
            Pid.METATRAFFIC_UNICAST_LOCATOR: locator,
            Pid.DEFAULT_UNICAST_LOCATOR: locator,
            Pid.PARTICIPANT_LEASE_DURATION: struct.pack("<iI", int(LEASE_S), 0),
        }
    )


def participant_disposal(guid_prefix: bytes) -> dict[int, bytes]:
    """Return the inline QoS of a DATA announcing the end of a participant."""
    return {Pid.KEY_HASH: guid_prefix + PARTICIPANT, Pid.STATUS_INFO: _DISPOSED_UNREGISTERED}


def endpoint_data(
    guid_prefix: bytes, entity_id: bytes, topic: str, type_: str, user_data: bytes = b""
) -> bytes:
    """Return the DiscoveredWriterData or DiscoveredReaderData of a reliable, volatile endpoint."""
    return PL_CDR_LE + encode_parameters(
        {
            Pid.ENDPOINT_GUID: guid_prefix + entity_id,
            Pid.PARTICIPANT_GUID: guid_prefix + PARTICIPANT,
            Pid.TOPIC_NAME: encode_string(topic),
            Pid.TYPE_NAME: encode_string(type_),
            Pid.RELIABILITY: _RELIABLE,
            Pid.DURABILITY: _VOLATILE,
            Pid.USER_DATA: struct.pack("<I", len(user_data)) + user_data,
        }
    )


def is_disposed(announcement: Data) -> bool:
    """Return whether an announcement is about the end of a participant or an endpoint."""
    return bool(int.from_bytes(announcement.inline_qos.get(Pid.STATUS_INFO, b"")) & _DISPOSED_UNREGISTERED[3])


def disposed_endpoint_id(announcement: Data) -> bytes:
    """Return the EntityId of an ending endpoint.

    Fast DDS sends the EntityId as a key hash in the inline QoS, Cyclone DDS in the payload.
    """
    guid = announcement.inline_qos.get(Pid.KEY_HASH) or parse_parameters(announcement.payload[4:])[0].get(
        Pid.ENDPOINT_GUID, b""
    )
    return guid[12:16]


def announced_participant(announcement: Data) -> tuple[int, int]:
    """Return the UDP ports of a participant: for metatraffic (SEDP), and for user data.

    Raises MessageError for missing or invalid ports.
    """
    found = _announced_parameters(announcement, Pid.METATRAFFIC_UNICAST_LOCATOR, Pid.DEFAULT_UNICAST_LOCATOR)
    metatraffic, default = (
        _port(found[locator]) for locator in (Pid.METATRAFFIC_UNICAST_LOCATOR, Pid.DEFAULT_UNICAST_LOCATOR)
    )
    return metatraffic, default


def _port(locator: bytes) -> int:
    """Return the port of a locator: kind, port (4 bytes each) and address (16 bytes)."""
    port = int.from_bytes(locator[4:8], "little")
    if len(locator) < 8 or not 0 < port < 1 << 16:
        raise MessageError(
            f"the discovery data of a participant has the UDP port {port}, allowed: 1 to 65535"
        )
    return port


def announced_endpoint(announcement: Data) -> tuple[bytes, bytes]:
    """Return topic name (in the form of a parameter) and EntityId of an announced endpoint.

    Raises MessageError if the announcement has not both.
    """
    found = _announced_parameters(announcement, Pid.TOPIC_NAME, Pid.ENDPOINT_GUID)
    return found[Pid.TOPIC_NAME], found[Pid.ENDPOINT_GUID][12:16]


def _announced_parameters(announcement: Data, *needed: Pid) -> dict[int, bytes]:
    found, _ = parse_parameters(announcement.payload[4:])
    if announcement.payload[:4] != PL_CDR_LE or set(needed) - found.keys():
        raise MessageError("the discovery data of a participant is not complete")
    return found
