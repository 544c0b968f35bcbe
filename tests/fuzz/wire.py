"""Mutated messages of a session: each is the value of a port, a grant, a request, or raises MessageError.

`python -m tests.fuzz.wire --number 100000 --seed 7 --hours 1`; `--case 7:123` repeats one message.
"""

from __future__ import annotations

import random
import struct
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import zenoh
from pydantic import BaseModel, ValidationError

from hub.devices.network_link import NetworkLinkOrder
from hub.devices.network_link_control import NetworkLinkRequest
from hub.transport.bundle import unpack_bundle
from hub.transport.control_messages import JoinReply, JoinRequest, Refusal, SetRequest, StepRequest
from hub.transport.envelope import Stamp, Tag
from hub.transport.port_codec import PortCodec
from schemas.codec import decode, message_types, typestore
from schemas.errors import MessageError
from schemas.lockstep import unpack_ack, unpack_grant
from schemas.ports import Port
from schemas.ros import StringMessage
from schemas.vectors import has_vector
from tests.fuzz.byte_mutations import DOUBLES, WORDS, mutated, mutated_text
from tests.fuzz.harness import Note, Target, search

PORTS = [
    Port(name="pose", causality="input", type="geometry_msgs/msg/PoseStamped", frame="world"),
    Port(name="twist", causality="input", type="geometry_msgs/msg/TwistStamped"),
    Port(name="number", causality="input", type="std_msgs/msg/Float64"),
    Port(name="array", causality="input", type="std_msgs/msg/Float64MultiArray", size=4, shape=(2, 2)),
    Port(
        name="joints",
        causality="input",
        type="sensor_msgs/msg/JointState",
        names=("a", "b", "c"),
        fields=("position", "effort"),
    ),
]
REQUESTS: dict[type[BaseModel], str] = {
    JoinRequest: '{"host": "a", "pid": 7, "bonds": {"tip": [{"name": "tip"}]}, "failed": "x: y"}',
    SetRequest: '{"participant": "robot", "port": "a", "value": [1.0, 2.0, {"x": [3]}]}',
    StepRequest: '{"steps": 3}',
    NetworkLinkRequest: '{"device": "hand", "delay": "70 ms", "jitter": "1 ms", "loss": 0.1, "outage": 5}',
    NetworkLinkOrder: '{"spec": {"delay": 70000000, "outages": [{"at": 1, "duration": 2}]}, "outage_ns": 3}',
    JoinReply: '{"session": "s", "run": 1, "admission": 1, "plan": {"step_ns": 1}, "params": {"a": {}},'
    ' "directory": "/", "watched": [["a", "b"]]}',
    Refusal: '{"refused": "why"}',
}


def _scalar(kind: str, source: random.Random, *, wild: bool) -> Any:
    """Return a value of a basic ROS type; if `wild`, one that our models may refuse."""
    if kind == "string":
        text = source.choice([*WORDS, b"world", b"a", b"running"])[:3000].decode("utf-8", "replace")
        return text if wild else text.replace("\0", "")[:20]
    if kind == "bool":
        return source.random() < 0.5
    if kind.startswith("float"):
        return np.dtype(kind).type(source.choice([*DOUBLES, 0.5]) if wild else source.uniform(-1, 1))
    kind = "uint8" if kind in ("byte", "char", "octet") else kind
    limits = np.iinfo(kind)
    return int(source.choice([limits.min, limits.max, 0, 1]) if wild else source.randrange(100))


def _value(field: tuple[int, Any], source: random.Random, *, wild: bool) -> Any:
    """Return a value of a field as rosbags defines it: (1 basic, 2 message, 3 array, 4 sequence; what)."""
    node, what = int(field[0]), field[1]
    if node == 1:
        return _scalar(what[0], source, wild=wild)
    if node == 2:
        return _message(what, source, wild=wild)
    element, count = what
    count = count if node == 3 else source.choice([0, 1, 3, 200 if wild else 2])
    values = [_value(element, source, wild=wild) for _ in range(count)]
    if int(element[0]) == 1 and element[1][0] not in ("string",):
        kind = element[1][0]
        return np.array(values, np.uint8 if kind in ("byte", "char", "octet") else kind)
    return values


def _message(name: str, source: random.Random, *, wild: bool) -> Any:
    """Return a message of `rosbags` with random fields."""
    _, fields = typestore().fielddefs[name]
    return typestore().types[name](
        **{field: _value(what, source, wild=wild and source.random() < 0.7) for field, what in fields}
    )


def cdr(name: str, source: random.Random, *, wild: bool) -> bytes:
    """Return the CDR of a random message."""
    try:
        return bytes(typestore().serialize_cdr(_message(name, source, wild=wild), name))
    except (struct.error, ValueError, OverflowError, AssertionError):  # rosbags cannot write it
        return bytes(typestore().serialize_cdr(_message(name, source, wild=False), name))


def _sample(data: bytes) -> Any:
    """Return what the envelopes read of a sample; Zenoh makes none but by sending."""
    return SimpleNamespace(attachment=zenoh.ZBytes(data))


def _request(model: type[BaseModel], data: bytes) -> None:
    """Read a request as the hub does, which catches ValueError and TypeError as well."""
    text = decode(StringMessage, struct.pack("<4sI", b"\0\1\0\0", len(data) + 1) + data + b"\0").data
    try:
        model.model_validate_json(text)
    except ValidationError as error:
        raise MessageError(f"an invalid request: {error.errors(include_url=False)[0]['msg']}") from error


@cache
def _codec(index: int, *, event: bool) -> PortCodec:
    return PortCodec(PORTS[index].model_copy(update={"variability": "event"}) if event else PORTS[index])


Reader = Callable[[bytes], Any]


def _made(source: random.Random) -> tuple[str, bytes, Reader]:
    """Return the name of a kind of message, the bytes of one, and its reader."""
    names = sorted(message_types())
    match source.randrange(10):
        case 0:
            model = source.choice(list(REQUESTS))
            return model.__name__, REQUESTS[model].encode(), lambda data: _request(model, data)
        case 1:
            tag = Tag.pack(source.randrange(2**64), 0, source.randrange(-1, 2**62), 5)
            return "tag", tag, lambda data: Tag.of(_sample(data))
        case 2:
            stamp = Stamp(1, source.randrange(2**62), 5).pack()
            return "stamp", stamp, lambda data: Stamp.of(_sample(data))
        case 3:
            parts = [cdr(source.choice(names), source, wild=False)[:300] for _ in range(3)]
            whole = b"".join(struct.pack("<II", i, len(part)) + part for i, part in enumerate(parts))
            return "bundle", whole, lambda data: list(unpack_bundle(data))
        case 4:
            return "grant", cdr("trocar_msgs/msg/Grant", source, wild=source.random() < 0.5), unpack_grant
        case 5:
            ack = cdr("trocar_msgs/msg/Ack", source, wild=source.random() < 0.5)
            steps, works = source.choice([(0, 0), (1, 0), (2, 3)])
            return "ack", ack, lambda data: unpack_ack(data, steps, works)
        case 6 | 7:
            codec = _codec(source.randrange(len(PORTS)), event=source.random() < 0.3)
            wild = source.random() < 0.5
            vector = codec.vector
            if vector is not None and not wild and has_vector(codec.port.type):
                data = codec.encode(vector.neutral, source.randrange(2**60))
            else:
                data = cdr(codec.port.type, source, wild=wild)
            return f"port {codec.port.name}", data, source.choice([codec.accept, codec.decode])
        case _:
            name = source.choice(names)
            data = cdr(name, source, wild=source.random() < 0.5)
            return name, data, lambda data: decode(message_types()[name], data)


def attempt(case: str, _directory: Path, note: Note) -> None:
    """Read the message of `case`, SEED:NUMBER."""
    source = random.Random(case)
    name, data, read = _made(source)
    label = "as made"
    if source.random() < 0.9:
        change = mutated_text if data[:1] == b"{" else mutated
        label, data = change(data, source, [_made(source)[1]])
    note(f"{name}: {label}")
    read(data)


def pristine(_directory: Path) -> None:
    """Read a message of every type."""
    source = random.Random(0)
    for name, model in message_types().items():
        try:
            decode(model, cdr(name, source, wild=False))
        except MessageError:  # a byte of ours has seven bits
            continue
    for model, text in REQUESTS.items():
        try:
            _request(model, text.encode())
        except MessageError:
            continue


if __name__ == "__main__":
    sys.exit(search(Target(attempt, pristine, batch=1000), __doc__ or "", hours=0.25))
