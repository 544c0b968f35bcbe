"""A service of our ROS 1 node."""

from __future__ import annotations

import struct
from functools import partial

from devices.ros.ros1.connection import Connection, Fields, FrameHandler, header_frame
from devices.ros.ros1.types import Wire, ros1_name, service_checksum
from devices.ros.topics.row import Row
from devices.ros.transport import ServiceHandler
from schemas.errors import MessageError

__all__ = ["Service"]

_FAILED = struct.Struct("<BI")


class Service:
    """Answers requests in the order of their arrival, one or many per connection."""

    def __init__(self, row: Row, handle: ServiceHandler, node: str) -> None:
        """`node`: name of our node."""
        self._handle, self._name = handle, row.topic
        self._request, self._response = Wire(f"{row.type}_Request"), Wire(f"{row.type}_Response")
        name = ros1_name(row.type)
        self._header = {
            "callerid": node,
            "md5sum": service_checksum(row.type),
            "request_type": f"{name}Request",
            "response_type": f"{name}Response",
            "type": name,
        }

    def on_header(self, client: Connection, fields: Fields) -> FrameHandler:
        """Accept a client. Raises MessageError for a header with another type."""
        ours, theirs = self._header["md5sum"], fields.get("md5sum", "*")
        if theirs not in (ours, "*"):
            raise MessageError(
                f"service {self._name} is {self._header['type']} with MD5 {ours}, not {theirs}"
            )
        client.send(header_frame(self._header))
        return partial(self._answer, client)

    def _answer(self, client: Connection, request: bytes) -> None:
        try:
            client.send(b"\x01" + self._response.frame(self._handle(self._request.cdr(request)), 0))
        except MessageError as error:
            reason = str(error).encode()
            client.send(_FAILED.pack(0, len(reason)) + reason)
