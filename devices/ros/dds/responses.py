"""Whose request it is, and how the response says so: each ROS middleware has a way of its own.

rmw_fastrtps names the client in inline QoS, and looks for that in the response; rmw_cyclonedds puts a header
before the request, and each of its clients looks for its own. Sources: ros2/rmw_fastrtps,
rmw_fastrtps_shared_cpp/src/rmw_request.cpp and rmw_response.cpp; ros2/rmw_cyclonedds,
rmw_cyclonedds_cpp/src/rmw_node.cpp (cdds_request_header_t).
"""

from __future__ import annotations

from devices.ros.dds.rtps import Data, encode_sequence_number
from devices.ros.dds.rtps_discovery import Pid

__all__ = ["CYCLONE_DDS", "FAST_DDS", "ResponseTo"]

FAST_DDS, CYCLONE_DDS = b"\x01\x0f", b"\x01\x10"
"""Vendors of participants, the first two bytes of the GUID prefix."""
_HEADER = slice(4, 20)
"""cdds_request_header_t, behind the encapsulation header: client and number of the request."""


class ResponseTo:
    """What the response to a request of the participant with the GUID prefix `prefix` must have."""

    def __init__(self, request: Data, prefix: bytes) -> None:
        self.request = request.payload
        """The request (CDR) without a header."""
        self.inline_qos: dict[int, bytes] = {}
        self._header = b""
        self._reader_id: bytes | None = None
        """Of the client; None: each client of the participant looks for its own header."""
        if prefix.startswith(FAST_DDS):
            qos = request.inline_qos
            client = qos.get(Pid.RELATED_SAMPLE_IDENTITY) or qos.get(Pid.RELATED_SAMPLE_IDENTITY_EPROSIMA)
            guid = (client or b"")[:16]
            identity = guid + encode_sequence_number(request.sequence_number)
            self.inline_qos = {
                int(Pid.RELATED_SAMPLE_IDENTITY): identity,
                int(Pid.RELATED_SAMPLE_IDENTITY_EPROSIMA): identity,
            }
            self._reader_id = guid[12:]
        else:
            self._header = request.payload[_HEADER]
            self.request = request.payload[: _HEADER.start] + request.payload[_HEADER.stop :]

    def is_for(self, ids: tuple[bytes, bytes], writer_id: bytes) -> bool:
        """Return whether the client has the reader of `ids` (our writer, its reader) for `writer_id`."""
        return ids[0] == writer_id and self._reader_id in (None, ids[1])

    def payload(self, content: bytes) -> bytes:
        """Return the payload of a response, of which `content` is the CDR."""
        return content[: _HEADER.start] + self._header + content[_HEADER.start :]
