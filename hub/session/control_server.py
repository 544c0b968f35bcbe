"""The control queryables of a session: join, clock, pause, resume, step, set, link, shutdown."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic_ns
from typing import Protocol, TypeVar

import numpy as np
import zenoh
from pydantic import BaseModel, ValidationError
from zenoh.handlers import Callback

from hub.devices.inlets import Inlets
from hub.devices.network_link_control import NetworkLinkControl, NetworkLinkRequest
from hub.session.run_state import RunState
from hub.transport.control_messages import ClockReply, Empty, JoinRequest, Refusal, SetRequest, StepRequest
from hub.transport.port_codec import PortCodec
from hub.transport.refusals import Refusals
from schemas.codec import decode, encode, message_type
from schemas.errors import MessageError, TrocarError
from schemas.keys import Keys
from schemas.ros import StringMessage

__all__ = ["ControlServer", "Joins"]

Q = TypeVar("Q", bound=BaseModel)

_LONGEST_REASON = 1000
"""Letters of a refusal, which quotes parts of the request."""


class Joins(Protocol):
    """Answers hosts that join."""

    def join(self, request: JoinRequest) -> BaseModel:
        """Return the reply; raises MessageError to refuse."""
        ...


class ControlServer:
    """Answers control requests in Zenoh's threads; a refused request gets the reason.

    Args:
        session: The hub's Zenoh session.
        keys: The keys of the session.
        state: What `pause`, `resume`, `step` and `shutdown` change.
        inlets: What `set` writes into.
        network_links: What `link` changes.
        joins: What answers `join`.
        refusals: Counts the requests that are refused.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: Keys,
        state: RunState,
        inlets: Inlets,
        network_links: NetworkLinkControl,
        joins: Joins,
        refusals: Refusals,
    ) -> None:
        self._refusals = refusals
        self._inlets = inlets
        self._queryables = [
            self._declare(
                session, keys.join("**"), JoinRequest, joins.join, lambda request: keys.join(request.host)
            ),
            self._declare(session, keys.control("pause"), Empty, lambda _: self._done(state.pause())),
            self._declare(session, keys.control("resume"), Empty, lambda _: self._done(state.resume())),
            self._declare(
                session,
                keys.control("step"),
                StepRequest,
                lambda request: self._done(state.step(request.steps)),
            ),
            self._declare(session, keys.control("set"), SetRequest, self._set),
            self._declare(session, keys.control("link"), NetworkLinkRequest, network_links.change),
            self._declare(session, keys.control("clock"), Empty, self._clock),
            self._declare(session, keys.control("shutdown"), Empty, lambda _: self._done(state.shutdown())),
        ]

    def _declare(
        self,
        session: zenoh.Session,
        key: str,
        model: type[Q],
        handler: Callable[[Q], BaseModel],
        key_of: Callable[[Q], str] | None = None,
    ) -> zenoh.Queryable[None]:
        """Answer on `key`; if that is a pattern, a request is allowed on the key that `key_of` returns."""

        def answer(query: zenoh.Query) -> None:
            at = key
            with query:
                try:
                    payload = b"" if query.payload is None else query.payload.to_bytes()
                    text = decode(StringMessage, payload).data if payload else "{}"
                    request = model.model_validate_json(text)
                    if key_of is not None:
                        if not query.key_expr.intersects(key_of(request)):
                            raise MessageError(
                                f"this request belongs on {key_of(request)}, and was sent on {query.key_expr}"
                            )
                        at = key_of(request)
                    reply = handler(request)
                except (TrocarError, ValueError, TypeError, ArithmeticError) as error:
                    reason = _reason(error)[:_LONGEST_REASON]
                    self._refusals.refuse(key, reason)
                    reply = Refusal(refused=reason)
                query.reply(
                    at,
                    encode(StringMessage(data=reply.model_dump_json())),
                    encoding=zenoh.Encoding.APPLICATION_CDR,
                )

        return session.declare_queryable(key, Callback(answer))

    @staticmethod
    def _clock(_: Empty) -> ClockReply:
        received_ns = monotonic_ns()
        return ClockReply(received_ns=received_ns, replied_ns=monotonic_ns())

    @staticmethod
    def _done(_nothing: None) -> Empty:
        return Empty()

    def _set(self, request: SetRequest) -> Empty:
        port = self._inlets.settable(request.participant, request.port)
        codec = PortCodec(port)
        if codec.vector is not None:
            message = codec.vector.to_message(
                codec.vector.checked(np.atleast_1d(np.asarray(request.value, np.float64))), 0
            )
        else:
            message = message_type(port.type).model_validate(request.value)
        self._inlets.offer(request.participant, request.port, encode(message), monotonic_ns())
        return Empty()

    def undeclare(self) -> None:
        """Answer no more."""
        for queryable in self._queryables:
            queryable.undeclare()


def _reason(error: Exception) -> str:
    """Return why a request is refused, for the person who sent it."""
    if not isinstance(error, ValidationError):
        return str(error)
    found = error.errors(include_url=False)
    return "; ".join(
        f"{'.'.join(map(str, detail['loc'])):.80}: {detail['msg'].removeprefix('Value error, ')} (got"
        f" {detail['input']!r:.200})"
        for detail in found
    )
