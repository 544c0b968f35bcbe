"""What ROS programs say, on its way into the simulation: checked, counted, and refused with a word on the arm's topics."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic_ns, time_ns

from devices.ros.commander import Commander
from devices.ros.row import Row
from devices.ros.rules import Refused, check, heard
from devices.ros.stamps import stamp_of
from devices.ros.traffic import Count
from schemas.codec import decode, message_type
from schemas.errors import MessageError
from schemas.message import Message

__all__ = ["Incoming", "Tell"]

Tell = Callable[[Row, str, str], None]
"""Says on a topic of the row's arm (`error`: it cannot be; `warning`: not now) why a message was refused."""

_MOST_PER_S = 1500
"""Messages per second on one topic: the frequency of a real arm's own loop, which reads no more (dVRK docs/pages/development/middleware.rst)."""
_BURST = 150
"""Messages that may come at once: of a tenth of a second."""


class Incoming:
    """One subscribed row."""

    def __init__(self, row: Row, commander: Commander | None, count: Count, hand_on: Callable[[Message], None], tell: Tell) -> None:
        """Take the row, who leads its arm (None: nobody asks), and where messages go."""
        self._row, self._commander, self._count, self._hand_on, self._tell = row, commander, count, hand_on, tell
        self._model = message_type(row.type)
        self._port = row.port
        self._begun_ns = time_ns()
        self._allowance, self._counted_ns = float(_BURST), monotonic_ns()

    def take(self, payload: bytes, client: str) -> None:
        """Hand on a message, or refuse it."""
        self._count.messages += 1
        if not self._has_allowance():
            self._refuse("warning", f"more than {_MOST_PER_S} messages per second from {client}: those beyond are not heeded")
            return
        try:
            message = decode(self._model, payload)
            check(message, self._row)
            if self._row.name == "state_command":
                self._check_age(message, client)
            if self._commander is not None and self._row.leads:
                self._commander.check(client)
            if self._port is not None and self._port.variability == "signal":
                message = heard(message, self._port)
        except Refused as refusal:
            self._refuse("warning", str(refusal))
        except MessageError as error:
            self._refuse("error", f"{error} (from {client})")
        else:
            self._hand_on(message)

    def _has_allowance(self) -> bool:
        now_ns = monotonic_ns()
        self._allowance = min(self._allowance + (now_ns - self._counted_ns) * 1e-9 * _MOST_PER_S, float(_BURST))
        self._counted_ns = now_ns
        if self._allowance < 1.0:
            return False
        self._allowance -= 1.0
        return True

    def _check_age(self, message: Message, client: str) -> None:
        """Raise Refused for a latched command that was given before the gateway was there: a client's connection has brought it, nobody gives it now."""
        stamp_ns = stamp_of(message)
        if stamp_ns and stamp_ns < self._begun_ns:
            ago = (time_ns() - stamp_ns) / 1e9
            raise Refused(f"given {ago:.1f} s ago by {client}'s clock, before this gateway was there: it is latched, not new; give it again if it is meant")

    def _refuse(self, topic: str, reason: str) -> None:
        self._count.refused += 1
        self._count.reason = reason
        self._tell(self._row, topic, reason)
