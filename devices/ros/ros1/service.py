"""A service that a node of ROS 1 answers."""

from __future__ import annotations

import struct
from functools import partial

from devices.ros.ros1.connection import Connection, Fields, Incoming, header_frame
from devices.ros.ros1.types import Wire, ros1_name, service_checksum
from devices.ros.topics.row import Row
from devices.ros.transport import Handler
from schemas.errors import MessageError

__all__ = ["Service"]

_FAILED = struct.Struct("<BI")


class Service:
    """Answers requests in the order in which they come; a program may ask once or often over one connection."""

    def __init__(self, row: Row, handle: Handler, node: str) -> None:
        """Take the service, what answers it, and the name of our node."""
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

    def greet(self, caller: Connection, fields: Fields) -> Incoming:
        """Take a program that wants to ask. Raises MessageError if it takes the service for something else."""
        ours, theirs = self._header["md5sum"], fields.get("md5sum", "*")
        if theirs not in (ours, "*"):
            raise MessageError(
                f"service {self._name} is {self._header['type']} with MD5 {ours}, not {theirs}"
            )
        caller.send(header_frame(self._header))
        return partial(self._answer, caller)

    def _answer(self, caller: Connection, request: bytes) -> None:
        try:
            caller.send(b"\x01" + self._response.frame(self._handle(self._request.cdr(request)), 0))
        except MessageError as error:
            word = str(error).encode()
            caller.send(_FAILED.pack(0, len(word)) + word)
