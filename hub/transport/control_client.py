"""Sends requests to the control queryables of a session."""

from __future__ import annotations

from contextlib import suppress
from time import monotonic, sleep
from typing import TypeVar

import zenoh
from pydantic import BaseModel, ValidationError

from hub.transport.control_messages import JoinReply, JoinRequest, Refusal
from schemas.codec import decode, encode
from schemas.errors import ConnectError, MessageError
from schemas.keys import Keys
from schemas.ros import StringMessage

__all__ = ["ask", "ask_as_child", "join_session"]

_STARTING_S = 5.0
"""A hub that has only just started to listen answers within this time."""
_ANSWER_S = 10.0
_RETRY_S = 0.1


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


def ask_as_child(session: zenoh.Session, key: str, request: BaseModel, reply_model: type[R]) -> R:
    """Send a control request from a process ending with the hub, until the hub answers.

    Raises MessageError if the request is refused.
    """
    while True:
        with suppress(ConnectError):
            return ask(session, key, request, reply_model, timeout_s=_ANSWER_S)
        sleep(_RETRY_S)


def join_session(session: zenoh.Session, keys: Keys, request: JoinRequest) -> JoinReply:
    """Join a session with a host, and return the hub's reply.

    Raises the errors of `ask`; a host started by the hub waits as long as the hub lives.
    """
    key = keys.join(request.host)
    if request.is_local:
        return ask_as_child(session, key, request, JoinReply)
    deadline = monotonic() + _STARTING_S
    while True:
        try:
            return ask(session, key, request, JoinReply, timeout_s=_ANSWER_S)
        except ConnectError:
            if monotonic() > deadline:
                raise
            sleep(_RETRY_S)
