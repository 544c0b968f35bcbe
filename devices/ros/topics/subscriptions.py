"""Messages of ROS programs on their way into the simulation: validated, counted, accepted or refused."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic_ns, time_ns

from devices.ros.status import Count
from devices.ros.topics.arbitration import CommandArbiter
from devices.ros.topics.row import Row
from devices.ros.topics.state_commands import RepeatedStateCommands
from devices.ros.topics.validation import as_signal, validate
from devices.samples import stamp_of
from hub.participant.token_bucket import TokenBucket
from schemas.codec import decode, message_type
from schemas.errors import MessageError
from schemas.message import Message

__all__ = ["Report", "SubscribedTopic"]

Report = Callable[[Row, str, str], None]
"""Reports a refusal with its reason on the arm's `error` (invalid message) or `warning` (not allowed now)."""

_MOST_PER_S = 1500
"""Most messages per second on a topic: the frequency of a real arm's own loop (dVRK
docs/pages/development/middleware.rst).
"""
_BURST = 150
"""Most messages at once: the messages of a tenth of a second."""


class SubscribedTopic:
    """A subscribed row; `receive` decides on every message."""

    def __init__(
        self,
        row: Row,
        arbiter: CommandArbiter | None,
        count: Count,
        accept: Callable[[Row, Message], None],
        report: Report,
    ) -> None:
        """`arbiter`: of the row's arm, None: every program may send; `accept`: gets accepted messages."""
        self._row, self._arbiter, self._count, self._accept, self._report = (
            row,
            arbiter,
            count,
            accept,
            report,
        )
        self._model = message_type(row.type)
        self._signal = row.port if row.port is not None and row.port.variability == "signal" else None
        self._opened_ns = monotonic_ns()
        self._repeated = RepeatedStateCommands()
        self._bucket = TokenBucket(_MOST_PER_S, _BURST)

    def receive(self, payload: bytes, client: str, /, *, connected_ns: int = 0) -> None:
        """Accept or refuse a message; a `devices.ros.transport.MessageHandler`."""
        self._count.messages += 1
        if not self._bucket.spend(monotonic_ns()):
            self._refuse(
                "warning", f"more than {_MOST_PER_S} messages per second from {client}: the rest is dropped"
            )
            return
        try:
            message = decode(self._model, payload)
            validate(message, self._row)
        except MessageError as error:
            self._refuse("error", f"{error} (from {client})")
            return
        reason = self._refusal(message, client, connected_ns)
        if reason is None:
            self._count.client = client
            self._accept(self._row, message if self._signal is None else as_signal(message, self._signal))
        else:
            self._refuse("warning", reason)

    def _refusal(self, message: Message, client: str, connected_ns: int) -> str | None:
        """Return why a valid message is not accepted now; None: accepted."""
        stamp_ns = stamp_of(message)
        if (stamp_ns or 0) < connected_ns and not self._row.is_real:
            return f"published by {client} before it was connected: if it is still meant, publish it again"
        if self._signal is not None and stamp_ns == 0:
            return f"marked invalid by {client} (stamp 0)"
        if self._row.name == "state_command" and stamp_ns:
            return self._latched_reason(stamp_ns, client)
        return self._arbiter.refusal(client) if self._arbiter is not None else None

    def _latched_reason(self, stamp_ns: int, client: str) -> str | None:
        """Return why a state command counts as a repeated delivery; None: a new command."""
        now_ns = time_ns()
        # by the wall clock of now: it may have been set since then
        if stamp_ns < now_ns - (monotonic_ns() - self._opened_ns):
            ago = (now_ns - stamp_ns) / 1e9
            return (
                f"published {ago:.1f} s ago by the clock of {client}, before this gateway was open: if it is"
                " still meant, publish it again"
            )
        # perhaps accepted in another session, of which the simulation does not know
        return self._repeated.refusal(stamp_ns)

    def _refuse(self, level: str, reason: str) -> None:
        self._count.refuse(reason)
        self._report(self._row, level, reason)
