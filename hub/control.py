"""The control queryables of a session: join, clock, pause, resume, step, set, link, shutdown; and the questions to ask them with.

Requests and replies are `std_msgs/String` messages that hold JSON.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from time import monotonic, monotonic_ns, sleep
from typing import Any, Protocol, TypeVar

import numpy as np
import zenoh
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from zenoh.handlers import Callback

from hub.inlets import Inlets
from hub.plan import Plan
from hub.relink import LinkRequest, Relink
from hub.wire import Drops, PortCodec
from schemas.codec import decode, encode, message_type
from schemas.errors import ConnectError, MessageError, TrocarError
from schemas.keys import Keys
from schemas.ports import BondSide
from schemas.ros import StringMessage

__all__ = ["ClockReply", "ControlServer", "Empty", "JoinReply", "JoinRequest", "Refusal", "RunState", "SetRequest", "StepRequest", "ask", "present"]

_PATIENCE_S = 5.0

R = TypeVar("R", bound=BaseModel)
Q = TypeVar("Q", bound=BaseModel)


class _Json(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Empty(_Json):
    """Nothing to say."""


class Refusal(_Json):
    """The reply to a request that is refused."""

    refused: str


class StepRequest(_Json):
    """Take this many steps, then pause."""

    steps: int = Field(default=1, ge=1)


class SetRequest(_Json):
    """Write `value` to an input that nothing feeds: numbers for a vector, else the message as JSON."""

    participant: str
    port: str
    value: Any


class JoinRequest(_Json):
    """A host process presents itself (first request), and says that its participants are configured (second)."""

    host: str
    pid: int
    ready: bool = False
    bonds: dict[str, tuple[BondSide, ...]] = {}
    failed: str = ""
    """Why the host cannot go on: `participant: cause`."""


class ClockReply(_Json):
    """What time it is by the hub's monotonic clock: when the question came, and when the answer went."""

    received_ns: int
    replied_ns: int


class JoinReply(_Json):
    """All that a host needs to make its participants."""

    session: str
    run: int
    admission: int
    """Counts the hosts that were let in: a device's samples carry it, so that those of a host before it are known."""
    plan: Plan
    """For another machine, the part of it that concerns the host."""
    params: dict[str, dict[str, Any]]
    directory: str
    watched: list[tuple[str, str]]
    """Outputs, as participant and port, whose every value the hub wants: for a recording or a measure."""


class RunState:
    """Whether the session runs, is paused or is to end; shared by the clock loop and the control threads."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._budget: int | None = None
        self._ending = False

    def pause(self) -> None:
        """Take no further step."""
        self._set(0)

    def resume(self) -> None:
        """Go on without limit."""
        self._set(None)

    def step(self, steps: int) -> None:
        """Take `steps` more steps, then pause."""
        with self._changed:
            self._budget = steps + (self._budget or 0)
            self._changed.notify_all()

    def shutdown(self) -> None:
        """End the session in good order at the next communication point."""
        with self._changed:
            self._ending = True
            self._changed.notify_all()

    def _set(self, budget: int | None) -> None:
        with self._changed:
            self._budget = budget
            self._changed.notify_all()

    @property
    def ending(self) -> bool:
        """Say whether the session is to end."""
        return self._ending

    @property
    def budget(self) -> int | None:
        """Steps that may be taken before the next pause; None: no limit."""
        return self._budget

    def wait(self, timeout_s: float) -> bool:
        """Wait while paused, at most `timeout_s`; say whether the session may go on."""
        with self._changed:
            self._changed.wait_for(lambda: self._budget != 0 or self._ending, timeout_s)
            return self._budget != 0 or self._ending

    def spend(self, steps: int) -> None:
        """Count steps that were taken."""
        with self._changed:
            if self._budget is not None:
                self._budget = max(self._budget - steps, 0)


class Joins(Protocol):
    """Who answers hosts that join."""

    def join(self, request: JoinRequest) -> BaseModel:
        """Return the reply; raises MessageError to refuse."""
        ...


class ControlServer:
    """Answers control requests in Zenoh's threads; a request that is refused gets the reason."""

    def __init__(self, session: zenoh.Session, keys: Keys, state: RunState, inlets: Inlets, relink: Relink, joins: Joins, drops: Drops) -> None:
        """Steer `state`, write into `inlets`, change links and let hosts join; what is refused is counted in `drops`."""
        self._drops = drops
        self._inlets = inlets
        self._queryables = [
            self._declare(session, keys.join("**"), JoinRequest, joins.join, lambda request: keys.join(request.host)),
            self._declare(session, keys.control("pause"), Empty, lambda _: self._done(state.pause())),
            self._declare(session, keys.control("resume"), Empty, lambda _: self._done(state.resume())),
            self._declare(session, keys.control("step"), StepRequest, lambda request: self._done(state.step(request.steps))),
            self._declare(session, keys.control("set"), SetRequest, self._set),
            self._declare(session, keys.control("link"), LinkRequest, relink.change),
            self._declare(session, keys.control("clock"), Empty, self._clock),
            self._declare(session, keys.control("shutdown"), Empty, lambda _: self._done(state.shutdown())),
        ]

    def _declare(
        self, session: zenoh.Session, key: str, model: type[Q], handler: Callable[[Q], BaseModel], key_of: Callable[[Q], str] | None = None
    ) -> zenoh.Queryable[None]:
        """Answer on `key`; where that stands for several, `key_of` says on which of them a request may come."""

        def answer(query: zenoh.Query) -> None:
            at = key
            with query:
                try:
                    payload = b"" if query.payload is None else query.payload.to_bytes()
                    text = decode(StringMessage, payload).data if payload else "{}"
                    request = model.model_validate_json(text)
                    if key_of is not None:
                        if not query.key_expr.intersects(key_of(request)):
                            raise MessageError(f"this request belongs on {key_of(request)}, and came on {query.key_expr}")
                        at = key_of(request)
                    reply = handler(request)
                except (TrocarError, ValueError, TypeError, ArithmeticError) as error:
                    reason = _reason(error)
                    self._drops.refuse(key, reason)
                    reply = Refusal(refused=reason)
                query.reply(at, encode(StringMessage(data=reply.model_dump_json())), encoding=zenoh.Encoding.APPLICATION_CDR)

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
            message = codec.vector.to_message(codec.vector.checked(np.atleast_1d(np.asarray(request.value, np.float64))), 0)
        else:
            message = message_type(port.type).model_validate(request.value)
        self._inlets.offer(request.participant, request.port, encode(message), monotonic_ns())
        return Empty()

    def undeclare(self) -> None:
        """Answer no more."""
        for queryable in self._queryables:
            queryable.undeclare()


def _reason(error: Exception) -> str:
    """Return why a request is refused, for the person who made it."""
    if not isinstance(error, ValidationError):
        return str(error)
    found = error.errors(include_url=False)
    return "; ".join(f"{'.'.join(map(str, detail['loc']))}: {detail['msg'].removeprefix('Value error, ')} (got {detail['input']!r})" for detail in found)


def ask(session: zenoh.Session, key: str, request: BaseModel, reply_model: type[R], *, timeout_s: float = 5.0) -> R:
    """Send a control request and return the reply.

    Raises ConnectError if nobody answers in time, MessageError if the request is refused.
    """
    replies = session.get(key, payload=encode(StringMessage(data=request.model_dump_json())), timeout=timeout_s)
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
                raise MessageError(f"{key} answered something else than {reply_model.__name__}") from error
    raise ConnectError(f"nobody answers on {key}: is the hub running, and does its session have what this names?")


def present(session: zenoh.Session, keys: Keys, request: JoinRequest) -> JoinReply:
    """Present a host to the hub, which gets a moment if it has only just begun to listen; raises what `ask` raises."""
    deadline = monotonic() + _PATIENCE_S
    while True:
        try:
            return ask(session, keys.join(request.host), request, JoinReply, timeout_s=10.0)
        except ConnectError:
            if monotonic() > deadline:
                raise
            sleep(0.1)
