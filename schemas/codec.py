"""CDR codecs: every message model to bytes and back, with .msg texts and RIHS01 hashes.

`rosbags` does everything; `_cdr.c`, where a compiler was present, encodes: a session encodes thousands of
messages a second between its steps (docs/decisions/0104-messages-encoded-in-c.md).
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Literal, TypeVar

from annotated_types import MaxLen
from pydantic import ValidationError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from schemas import crtk, ros, trocar_msgs, visualization
from schemas.errors import MessageError, did_you_mean
from schemas.message import Message, field_types, msg_text

try:
    from schemas import _cdr as compiled
except ImportError:  # there was no compiler: the same bytes, more slowly
    compiled = None

if TYPE_CHECKING:
    from schemas._cdr import Encoder

__all__ = [
    "check_first_sequence",
    "compiled",
    "decode",
    "encode",
    "encode_as",
    "message_type",
    "message_types",
    "rihs01",
    "ros2msg_definition",
    "typestore",
    "validate_message",
]

MAX_MESSAGE_BYTES = 16 * 2**20
"""Larger payloads are rejected unread.

The largest plausible message, an uncompressed 1080p stereo image, has 12 MB.
"""

_PLAIN_CDR = (b"\x00\x00", b"\x00\x01")
"""The representation identifiers CDR_BE and CDR_LE of OMG DDSI-RTPS."""

_KINDS = {
    "bool": "?",
    "byte": "b",
    "uint8": "B",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
    "string": "s",
}
"""Kinds of `_cdr.c`; `m` is a message."""
_ONE, _SEQUENCE = -1, 0
"""Counts in `_cdr.c` of a single value and of a sequence."""

M = TypeVar("M", bound=Message)


@cache
def message_types() -> dict[str, type[Message]]:
    """Return every message model by its ROS type name."""
    models = (value for module in (ros, crtk, visualization, trocar_msgs) for value in vars(module).values())
    return {
        m.ros_type: m for m in models if isinstance(m, type) and issubclass(m, Message) and m is not Message
    }


def message_type(name: str) -> type[Message]:
    """Return the model of ROS type `name`."""
    try:
        return message_types()[name]
    except KeyError:
        raise MessageError(f"unknown message type '{name}'.{did_you_mean(name, message_types())}") from None


@cache
def typestore() -> Typestore:
    """Return the type store: ROS 2 Jazzy, CRTK and our own types."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, model in message_types().items():
        if name not in store.types:
            # the parser puts `msg` into the name of a service's parts
            (fields,) = get_types_from_msg(msg_text(model), name).values()
            store.register({name: fields})
    return store


def encode(message: Message) -> bytes:
    """Return `message` as little-endian CDR with its encapsulation header."""
    encoder = _encoder(type(message), lists=False)
    encoded = None if encoder is None else encoder.encode(message)
    return _by_rosbags(message) if encoded is None else encoded


def encode_as(model: type[Message], values: object) -> bytes:
    """Return the message of type `model` with the attributes of `values`, in CDR.

    Numbers may be in lists, and are not validated: the step loop has made them. Raises MessageError for
    values that such a message cannot have.
    """
    encoder = _encoder(model, lists=True)
    encoded = None if encoder is None else encoder.encode(values)
    return _by_rosbags(validate_message(model, values)) if encoded is None else encoded


def _by_rosbags(message: Message) -> bytes:
    return bytes(typestore().serialize_cdr(message, message.ros_type))


@cache
def _encoder(model: type[Message], *, lists: bool) -> Encoder | None:
    if compiled is None:
        return None
    fields = [(name, *_field(text, lists=lists)) for name, text in field_types(model).items()]
    return compiled.Encoder(fields, lists=lists)


def _field(text: str, *, lists: bool) -> tuple[str, int, Encoder | None]:
    """Return kind, count and, for a message, encoder of a field, from the field's type in a .msg file."""
    element, is_array, count = text.partition("[")
    number = int(count[:-1] or _SEQUENCE) if is_array else _ONE
    if element in _KINDS:
        return _KINDS[element], number, None
    return "m", number, _encoder(message_type(element.replace("/", "/msg/")), lists=lists)


def decode(model: type[M], payload: bytes) -> M:
    """Return the message of type `model` in `payload`.

    Raises MessageError if the bytes are too many, too few or no such message, or if a value is out of its
    range.
    """
    if len(payload) > MAX_MESSAGE_BYTES:
        raise MessageError(f"{model.ros_type}: {len(payload)} bytes exceed the limit of {MAX_MESSAGE_BYTES}")
    if bytes(payload[:2]) not in _PLAIN_CDR:
        raise MessageError(
            f"{model.ros_type}: {len(payload)} bytes are no such message (they do not begin as CDR)"
        )
    check_first_sequence(model, payload[4:8], "big" if payload[1] == 0 else "little")
    try:
        raw = typestore().deserialize_cdr(payload, model.ros_type)
    except (
        Exception
    ) as error:  # rosbags raises struct.error, IndexError, AssertionError, UnicodeDecodeError ...
        raise MessageError(
            f"{model.ros_type}: {len(payload)} bytes are no such message ({type(error).__name__}: {error})"
        ) from error
    return validate_message(model, raw)


def check_first_sequence(model: type[Message], length: bytes, order: Literal["big", "little"]) -> None:
    """Refuse a message with a first sequence longer than the type allows, before reading the message.

    `length`: first four bytes of the message, in byte `order`. Raises MessageError.
    """
    field, most = _first_sequence(model)
    if field and (count := int.from_bytes(length, order)) > most:
        raise MessageError(f"{model.ros_type}: {count} {field}, allowed are at most {most} in one message")


@cache
def _first_sequence(model: type[Message]) -> tuple[str, int]:
    """Return name and greatest length of the first field if the field is a list of limited length."""
    for name, field in model.model_fields.items():
        for mark in field.metadata:
            if isinstance(mark, MaxLen):
                return name, mark.max_length
        break
    return "", 0


def validate_message(model: type[M], raw: object) -> M:
    """Return the message of type `model` with the fields of `raw`, a message of `rosbags`.

    Raises MessageError if a value is out of range.
    """
    try:
        return model.model_validate(raw, from_attributes=True)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        path = ".".join(str(part) for part in first["loc"])
        raise MessageError(f"{model.ros_type}: {path}: {first['msg']}") from error


@cache
def rihs01(name: str) -> str:
    """Return the type hash (REP-2016) of ROS type `name`, `RIHS01_...`."""
    return typestore().hash_rihs01(name)


@cache
def ros2msg_definition(name: str) -> str:
    """Return the definition of `name` and of every type contained, in MCAP's `ros2msg` schema encoding."""
    text, _ = typestore().generate_msgdef(name, ros_version=2)
    return text
