"""The port of a recorded message."""

from __future__ import annotations

from typing import Any

from schemas import ros
from schemas.codec import decode, message_type
from schemas.ports import Port
from schemas.vectors import has_vector

__all__ = ["output_port"]


def output_port(name: str, type_name: str, payload: bytes) -> Port:
    """Return the output port for messages such as `payload`.

    Types with a fixed layout are signals, with frame, joint names and sizes as in `payload`; all remaining
    types events. Raises MessageError.
    """
    model = message_type(type_name)
    if not has_vector(type_name):
        return Port(name=name, causality="output", type=type_name, variability="event")
    message = decode(model, payload)
    known: dict[str, Any] = {}
    if isinstance(message, ros.JointState):
        sizes = {field: getattr(message, field).size for field in ("position", "velocity", "effort")}
        known = {
            "names": tuple(message.name),
            "fields": tuple(field for field in sizes if sizes[field]) or ("position",),
            "size": max(1, *sizes.values()),
        }
    elif isinstance(message, ros.Float64MultiArray):
        known = {"size": max(1, message.data.size)}
    header = getattr(message, "header", None)
    frame = header.frame_id if isinstance(header, ros.Header) else ""
    return Port(name=name, causality="output", type=type_name, frame=frame, **known)
