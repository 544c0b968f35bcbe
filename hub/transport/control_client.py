"""Sends requests to the control queryables of a session."""

from __future__ import annotations

from time import monotonic, sleep
from typing import TypeVar

import zenoh
from pydantic import BaseModel, ValidationError

from hub.transport.control_messages import JoinReply, JoinRequest, Refusal
from schemas.codec import decode, encode
from schemas.errors import ConnectError, MessageError
from schemas.keys import Keys
from schemas.ros import StringMessage

__all__ = ["ask", "join_session"]

_PATIENCE_S = 5.0


R = TypeVar("R", bound=BaseModel)


def ask(
    session: zenoh.Session, key: str, request: BaseModel, reply_model: type[R], *, timeout_s: float = 5.0
) -> R:
    """Send a control request and return the reply.

    Raises ConnectError if there is no answer in time, MessageError if the request is refused.
    """
    replies = session.get(
        key, payload=encode(StringMessage(data=request.model_dump_json())), timeout=timeout_s
    )
    for reply in replies:
        if reply.ok is None:
            continue
        text = decode(StringMessage, reply.ok.payload.to_bytes()).data
        try:
            return reply_model.model_validate_json(text)
        except ValidationError:
            try:
                raise MessageError(Refusal.model_validate_json(text).refused) from None
            except ValidationError as error:
                raise MessageError(f"the answer on {key} is not a valid {reply_model.__name__}") from error
    raise ConnectError(f"no answer on {key}: is the hub running, and does its session have what this names?")


def join_session(session: zenoh.Session, keys: Keys, request: JoinRequest) -> JoinReply:
    """Join a session with a host, and return the hub's reply.

    A hub that has only just started to listen gets a few seconds. Raises what `ask` raises.
    """
    deadline = monotonic() + _PATIENCE_S
    while True:
        try:
            return ask(session, keys.join(request.host), request, JoinReply, timeout_s=10.0)
        except ConnectError:
            if monotonic() > deadline:
                raise
            sleep(0.1)
