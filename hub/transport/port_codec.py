"""Values of a port to CDR and back."""

from __future__ import annotations

from collections.abc import Hashable
from functools import lru_cache
from typing import Any, cast

from hub.participant import Value
from schemas.codec import decode, encode, message_type
from schemas.message import Message
from schemas.ports import Port
from schemas.vectors import VectorCodec, has_vector

__all__ = ["PortCodec", "codec_of"]

_PORTS = 4096
"""Number of ports with kept codecs: some times the ports of the largest session."""


Layout = tuple[str, str, int, tuple[int, ...], tuple[str, ...], tuple[str, ...], str]
"""Type, variability, size, shape, joint names, fields and frame of a port."""


class PortCodec:
    """Encodes and decodes the values of a port, of any type.

    The newest message is encoded once for all readers and the recorder: a picture has megabytes.
    """

    def __init__(self, port: Port) -> None:
        self.port = port
        self.is_event = port.variability == "event"
        self.vector = VectorCodec(port) if has_vector(port.type) and not self.is_event else None
        self.layout: Layout = (
            port.type,
            port.variability,
            port.size,
            port.shape,
            port.names,
            port.fields,
            port.frame,
        )
        """Codecs of equal layout accept the same bytes as the same value."""
        self._model = message_type(port.type)
        self._newest: tuple[Message | None, bytes] = None, b""
        """Message and CDR."""

    def encode(self, value: Any, time_ns: int) -> bytes:
        """Return a vector or message as CDR."""
        return self.vector.encode(value, time_ns) if self.vector is not None else self._encode_value(value)

    def _encode_value(self, message: Message) -> bytes:
        newest, payload = self._newest
        if message is not newest:
            payload = encode(message)
            self._newest = message, payload
        return payload

    def decode(self, payload: bytes) -> Any:
        """Return the vector or message in `payload`, encoded by a `PortCodec` of the same port.

        Raises MessageError if the payload is invalid.
        """
        return self.vector.decode(payload) if self.vector is not None else decode(self._model, payload)

    def pack(self, value: Any) -> bytes:
        """Return a signal's value for a bundle: a vector as numbers alone, a message as CDR."""
        return value.tobytes() if self.vector is not None else self._encode_value(value)

    def unpack(self, payload: bytes) -> Any:
        """Return a value packed by a `PortCodec` of the same port; raises MessageError if invalid."""
        return self.vector.unpack(payload) if self.vector is not None else decode(self._model, payload)

    def accept(self, payload: bytes) -> Any:
        """Return the vector or message in `payload`, from any sender: joints in any order, frame left out.

        Raises MessageError if the payload is invalid.
        """
        if self.vector is not None and (found := self.vector.find_vector(payload)) is not None:
            return found
        message = decode(self._model, payload)
        return self.vector.from_message(message) if self.vector is not None else message

    def batch(self, value: Value) -> tuple[Message, ...]:
        """Return the messages of an event port's value."""
        return value if isinstance(value, tuple) else ()


def codec_of(port: Port) -> PortCodec:
    """Return the codec of a port, the same at every call: making a codec takes 0.1 ms.

    A published or recorded output has a codec of its own, with the newest message.
    """
    return _kept_codec(cast("Hashable", port))


@lru_cache(maxsize=_PORTS)
def _kept_codec(port: Hashable) -> PortCodec:
    return PortCodec(cast("Port", port))
