"""What ROS programs say, on its way into the simulation: checked, counted, and refused with a word on the
arm's topics.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from time import monotonic_ns, time_ns

from devices.ros.topics.commander import Commander
from devices.ros.topics.row import Row
from devices.ros.topics.rules import as_signal, check
from devices.ros.topics.stamps import stamp_of
from devices.ros.traffic import Count
from schemas.codec import decode, message_type
from schemas.errors import MessageError
from schemas.message import Message

__all__ = ["Incoming", "Tell"]

Tell = Callable[[Row, str, str], None]
"""Says on a topic of the row's arm (`error`: it cannot be; `warning`: not now) why a message was refused."""

_MOST_PER_S = 1500
"""Messages per second on one topic: the frequency of a real arm's own loop, which reads no more (dVRK
docs/pages/development/middleware.rst).
"""
_BURST = 150
"""Messages that may come at once: of a tenth of a second."""


_REMEMBERED = 8
"""State commands; more programs than that do not command one arm."""


class Incoming:
    """One subscribed row."""

    def __init__(
        self,
        row: Row,
        commander: Commander | None,
        count: Count,
        hand_on: Callable[[Row, Message], None],
        tell: Tell,
    ) -> None:
        """Take the row, who leads its arm (None: nobody asks), and where messages go."""
        self._row, self._commander, self._count, self._hand_on, self._tell = (
            row,
            commander,
            count,
            hand_on,
            tell,
        )
        self._model = message_type(row.type)
        self._state = row.port if row.port is not None and row.port.variability == "signal" else None
        self._begun_ns = time_ns()
        self._heeded: deque[int] = deque(maxlen=_REMEMBERED)
        """Stamps of the newest state commands."""
        self._allowance, self._counted_ns = float(_BURST), monotonic_ns()

    def take(self, payload: bytes, client: str, /, *, linked_ns: int = 0) -> None:
        """Hand on a message, or refuse it."""
        self._count.messages += 1
        if not self._has_allowance():
            self._refuse(
                "warning",
                f"more than {_MOST_PER_S} messages per second from {client}: those beyond are not heeded",
            )
            return
        try:
            message = decode(self._model, payload)
            check(message, self._row)
        except MessageError as error:
            self._refuse("error", f"{error} (from {client})")
            return
        reason = self._not_now(message, client, linked_ns)
        if reason is None:
            self._hand_on(self._row, message if self._state is None else as_signal(message, self._state))
        else:
            self._refuse("warning", reason)

    def _not_now(self, message: Message, client: str, linked_ns: int) -> str | None:
        """Return why a valid message is not heeded now."""
        stamp_ns = stamp_of(message)
        if (stamp_ns or 0) < linked_ns and not self._row.is_real:
            return f"kept by {client} from before it was connected: if it is meant, give it again"
        if self._state is not None and stamp_ns == 0:
            return f"marked invalid by {client} (stamp 0)"
        if self._row.name == "state_command" and stamp_ns:
            return self._latched(stamp_ns, client)
        return self._commander.refusal(client) if self._commander is not None else None

    def _latched(self, stamp_ns: int, client: str) -> str | None:
        """Return why a state command is one that a new connection has brought, though nobody gives it now;
        otherwise remember it.
        """
        if stamp_ns < self._begun_ns:
            ago = (time_ns() - stamp_ns) / 1e9
            return (
                f"given {ago:.1f} s ago by the clock of {client}, before this gateway was there: if it is"
                " meant, give it again"
            )
        if stamp_ns in self._heeded:  # maybe in another session: then the simulation does not know
            return f"heeded before, with the same stamp, {stamp_ns / 1e9:.9f} s: a new one has a new stamp"
        self._heeded.append(stamp_ns)
        return None

    def _has_allowance(self) -> bool:
        now_ns = monotonic_ns()
        self._allowance = min(
            self._allowance + (now_ns - self._counted_ns) * 1e-9 * _MOST_PER_S, float(_BURST)
        )
        self._counted_ns = now_ns
        if self._allowance < 1.0:
            return False
        self._allowance -= 1.0
        return True

    def _refuse(self, topic: str, reason: str) -> None:
        self._count.refused += 1
        self._count.reason = reason
        self._tell(self._row, topic, reason)
