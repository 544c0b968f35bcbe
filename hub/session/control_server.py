"""The control queryables of a session: join, describe, clock, pause, resume, step, set, link, shutdown."""

from __future__ import annotations

import logging
from collections.abc import Callable
from queue import Full, Queue
from threading import Thread
from time import monotonic_ns
from typing import Protocol, TypeVar

import numpy as np
import zenoh
from pydantic import BaseModel, ValidationError
from zenoh.handlers import Callback

from hub.devices.inlets import Inlets
from hub.devices.network_link_control import NetworkLinkControl, NetworkLinkRequest
from hub.participant.token_bucket import TokenBucket
from hub.session.run_state import RunState
from hub.transport.control_messages import (
    ClockReply,
    DescribeReply,
    Empty,
    JoinRequest,
    Refusal,
    SetRequest,
    StepRequest,
)
from hub.transport.control_text import MOST_BYTES, control_text
from hub.transport.port_codec import PortCodec
from hub.transport.run_connection import RunConnection
from schemas.codec import encode, message_type
from schemas.errors import MessageError, TrocarError
from schemas.ros import StringMessage

__all__ = ["ControlServer", "Joins"]

log = logging.getLogger(__name__)

_MOST_WAITING = 64
_RATE = 100.0
"""Requests per second on a key: a device asks for the time 20 times a second at first, then twice.

Zenoh does not tell the sender of a query: all senders on a key share the rate; each host joins on a separate
key.
"""
_LONGEST_REASON = 1000
"""Most letters of a refusal; a refusal quotes parts of the request."""

Q = TypeVar("Q", bound=BaseModel)


class Joins(Protocol):
    """Answers joining hosts."""

    def join(self, request: JoinRequest) -> BaseModel:
        """Return the reply; raises MessageError to refuse."""
        ...


class ControlServer:
    """Answers control requests in a thread of its own; a refused request gets the reason.

    Requests too long, too frequent or too many to wait are refused at once, unread.

    Args:
        run: The hub's connection to the run.
        state: State changed by `pause`, `resume`, `step` and `shutdown`.
        inlets: Inputs written by `set`.
        network_links: Links changed by `link`.
        joins: Answers `join`.
        description: The answer to `describe`.
    """

    def __init__(
        self,
        run: RunConnection,
        state: RunState,
        inlets: Inlets,
        network_links: NetworkLinkControl,
        joins: Joins,
        description: DescribeReply,
    ) -> None:
        session, keys, self._refusals = run.session, run.keys, run.refusals
        self._inlets = inlets
        self._tuned: dict[str, float] = {}
        """Newest value set of each tunable parameter, by `participant.port`."""
        self._waiting: Queue[Callable[[], None] | None] = Queue(_MOST_WAITING)
        self._thread = Thread(target=self._run, name="control", daemon=True)
        self._thread.start()
        self._queryables = [
            self._declare_queryable(
                session, keys.join("**"), JoinRequest, joins.join, lambda request: keys.join(request.host)
            ),
            self._declare_queryable(
                session,
                keys.control("describe"),
                Empty,
                lambda _: description.model_copy(update={"tuned": dict(self._tuned)}),
            ),
            self._declare_queryable(
                session, keys.control("pause"), Empty, lambda _: self._answer_done(state.pause())
            ),
            self._declare_queryable(
                session, keys.control("resume"), Empty, lambda _: self._answer_done(state.resume())
            ),
            self._declare_queryable(
                session,
                keys.control("step"),
                StepRequest,
                lambda request: self._answer_done(state.step(request.steps)),
            ),
            self._declare_queryable(session, keys.control("set"), SetRequest, self._set),
            self._declare_queryable(
                session, keys.control("link"), NetworkLinkRequest, network_links.change_link
            ),
            self._declare_queryable(session, keys.control("clock"), Empty, self._clock),
            self._declare_queryable(
                session, keys.control("shutdown"), Empty, lambda _: self._answer_done(state.shutdown())
            ),
        ]

    def _declare_queryable(
        self,
        session: zenoh.Session,
        key: str,
        model: type[Q],
        handler: Callable[[Q], BaseModel],
        key_of: Callable[[Q], str] | None = None,
    ) -> zenoh.Queryable[None]:
        """Answer on `key`; for a pattern, a request is allowed on the key returned by `key_of`."""
        limit = TokenBucket(_RATE)

        def accept(query: zenoh.Query) -> None:
            payload = b"" if query.payload is None else query.payload.to_bytes()
            try:
                if len(payload) > MOST_BYTES:
                    raise MessageError(f"{len(payload)} bytes, a control message has at most {MOST_BYTES}")
                if not limit.spend(monotonic_ns()):
                    raise MessageError(f"more than {_RATE:g} requests/s")
                self._waiting.put_nowait(lambda: answer(query, payload))
            except MessageError as error:
                self._refuse(query, key, str(error))
            except Full:
                self._refuse(query, key, f"{_MOST_WAITING} requests wait already")

        def answer(query: zenoh.Query, payload: bytes) -> None:
            try:
                request = model.model_validate_json(control_text(payload) if payload else "{}")
                at = key if key_of is None else key_of(request)
                if not query.key_expr.intersects(at):
                    raise MessageError(f"this request belongs on {at}, and was sent on {query.key_expr}")
                reply = handler(request)
            except (TrocarError, ValueError, TypeError, ArithmeticError) as error:
                self._refuse(query, key, _reason(error)[:_LONGEST_REASON])
            else:
                _send_reply(query, at, reply)

        return session.declare_queryable(key, Callback(accept, indirect=False))

    def _refuse(self, query: zenoh.Query, key: str, reason: str) -> None:
        self._refusals.refuse(key, reason)
        _send_reply(query, key, Refusal(refused=reason))

    def _run(self) -> None:
        while (answer := self._waiting.get()) is not None:
            try:
                answer()
            except Exception:
                log.exception("a control request is not answered")  # the next ones are

    @staticmethod
    def _clock(_: Empty) -> ClockReply:
        received_ns = monotonic_ns()
        return ClockReply(received_ns=received_ns, replied_ns=monotonic_ns())

    @staticmethod
    def _answer_done(_nothing: None) -> Empty:
        return Empty()

    def _set(self, request: SetRequest) -> Empty:
        port = self._inlets.settable(request.participant, request.port)
        codec = PortCodec(port)
        if codec.vector is not None:
            vector = codec.vector.check_vector(np.atleast_1d(np.asarray(request.value, np.float64)))
            port.check_limits(vector[0])
            message = codec.vector.to_message(vector, 0)
            if port.limits is not None:
                self._tuned[f"{request.participant}.{port.name}"] = float(vector[0])
        else:
            message = message_type(port.type).model_validate(request.value)
        self._inlets.offer(request.participant, request.port, encode(message), monotonic_ns())
        return Empty()

    def undeclare(self) -> None:
        """Answer no more."""
        for queryable in self._queryables:
            queryable.undeclare()
        self._waiting.put(None)
        self._thread.join()


def _send_reply(query: zenoh.Query, key: str, reply: BaseModel) -> None:
    with query:
        query.reply(
            key,
            encode(StringMessage(data=reply.model_dump_json())),
            encoding=zenoh.Encoding.APPLICATION_CDR,
        )


def _reason(error: Exception) -> str:
    """Return the reason of a refusal, for the sender of the request."""
    if not isinstance(error, ValidationError):
        return str(error)
    found = error.errors(include_url=False)
    return "; ".join(
        f"{'.'.join(map(str, detail['loc'])):.80}: {detail['msg'].removeprefix('Value error, ')} (got"
        f" {detail['input']!r:.200})"
        for detail in found
    )
