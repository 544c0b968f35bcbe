"""Type hashes of services (REP-2016): `rosbags` computes hashes of messages only."""

from __future__ import annotations

from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from schemas.codec import typestore

__all__ = ["service_hash"]

_EVENT_INFO = "service_msgs/msg/ServiceEventInfo"
_EVENT_INFO_TEXT = (
    "uint8 event_type\nbuiltin_interfaces/Time stamp\nuint8[16] client_gid\nint64 sequence_number"
)
"""Text of the event info as hashed by ROS 2 Jazzy: a `char` of a .msg file is a uint8 in the type
description.
"""


def service_hash(name: str, request: str, response: str) -> str:
    """Return the hash of a service, `RIHS01_...`.

    A service is described as a type of three fields: request, response, and an event with at most one of each
    (rosidl_parser's definition of a service; `tests/devices/ros/zenoh` compares the result with the type
    description shipped in std_srvs of Jazzy).

    Args:
        name: `std_srvs/srv/Trigger`.
        request: .msg text of the request.
        response: .msg text of the response.
    """
    store = get_typestore(Stores.EMPTY)
    store.fielddefs.update(typestore().fielddefs)
    event = f"{_EVENT_INFO} info\n{name}_Request[<=1] request\n{name}_Response[<=1] response"
    whole = f"{name}_Request request_message\n{name}_Response response_message\n{name}_Event event_message"
    parts = {
        _EVENT_INFO: _EVENT_INFO_TEXT,
        f"{name}_Request": request,
        f"{name}_Response": response,
        f"{name}_Event": event,
        name: whole,
    }
    for part, text in parts.items():
        (definition,) = get_types_from_msg(text, part).values()
        store.fielddefs[part] = _rename_type(definition)
    return store.hash_rihs01(name)


def _rename_type(definition: Any) -> Any:
    """Return a definition of rosbags with ROS's names of a service's types: rosbags inserts `msg`."""
    if isinstance(definition, str):
        return definition.replace("/srv/msg/", "/srv/")
    if isinstance(definition, list | tuple):
        return type(definition)(_rename_type(part) for part in definition)  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]
    return definition
