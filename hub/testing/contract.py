"""Common rules of engines, controllers and devices: declarations and messages."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import ValidationError

from hub.participant import Device, Stepped
from hub.transport.port_codec import PortCodec
from schemas.codec import encode
from schemas.errors import MessageError
from schemas.files import Files
from schemas.message import Message
from schemas.ports import Port

__all__ = ["check_declarations", "check_message", "require"]


def require(condition: bool, rule: str) -> None:
    """Raise AssertionError with `rule` if `condition` is false."""
    if not condition:
        raise AssertionError(f"the contract of hub.participant: {rule}")


def check_declarations(participant: Stepped | Device) -> None:
    """Check the ports and the parameters of a participant before the start."""
    ports = participant.ports
    names = [port.name for port in ports]
    require(len(set(names)) == len(names), f"port names are unique, but these are {names}")
    require(ports == participant.ports, "ports are the same each time they are read")
    for port in ports:
        codec = PortCodec(port).vector  # raises MessageError for an unknown type
        if port.start is not None:
            fits = len(port.start) == (0 if codec is None else codec.size)
            require(
                fits,
                f"the start value of input '{port.name}' has one number for each of the port, none for a"
                f" message, but it is {port.start}",
            )
    params = participant.params
    try:
        again = type(participant).params_model.model_validate_json(
            params.model_dump_json(), context=Files(Path.cwd()).context
        )
    except ValidationError as error:
        raise AssertionError(
            f"the contract of hub.participant: parameters survive JSON, but {params!r} do not: {error}"
        ) from error
    require(again == params, f"parameters survive JSON, but {params!r} became {again!r}")


def check_message(port: Port, message: Any, where: str) -> None:
    """Check that a message fits the port; `where`: name of the returning method."""
    require(isinstance(message, Message), f"{where} gives messages on '{port.name}', but also {message!r}")
    require(
        message.ros_type == port.type,
        f"{where} gives {port.type} on '{port.name}', but also {message.ros_type}",
    )
    try:
        PortCodec(port).accept(encode(message))
    except MessageError as error:
        raise AssertionError(f"{where} gives what its ports declare: {error}") from error
