"""Identification of a request's client in the response, different in each ROS middleware.

rmw_fastrtps names the client in inline QoS, in the request and in the response; rmw_cyclonedds puts a header
before the request, and each client looks for its own header. Sources: ros2/rmw_fastrtps,
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
    """Identification in the response to a request of the participant with the GUID prefix `prefix`."""

    def __init__(self, request: Data, prefix: bytes) -> None:
        self.request = request.payload
        """The request (CDR) without a header."""
        self.inline_qos: dict[int, bytes] = {}
        self._header = b""
        self._reader_id: bytes | None = None
        """EntityId of the client's reader; None: each client of the participant looks for its own header."""
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
        """Return whether the client has the reader of `ids` (our writer, client's reader) for `writer_id`."""
        return ids[0] == writer_id and self._reader_id in (None, ids[1])

    def payload(self, content: bytes) -> bytes:
        """Return the payload of a response with the CDR `content`."""
        return content[: _HEADER.start] + self._header + content[_HEADER.start :]
