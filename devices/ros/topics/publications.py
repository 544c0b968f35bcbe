"""Publication to ROS programs: the newest value of each state at a period, and events at once."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from time import monotonic_ns
from typing import Protocol

from devices.ros.status import Count
from devices.ros.topics.stamps import Stamps
from devices.ros.transport import Publisher
from devices.samples import stamp_message
from hub.participant import Value
from schemas.codec import encode
from schemas.errors import DeviceError
from schemas.message import Message
from schemas.ports import Port
from schemas.vectors import Vector, VectorCodec

__all__ = [
    "Arrivals",
    "EventTopic",
    "MessageSource",
    "PeriodicTopic",
    "Publications",
    "State",
    "WantedSource",
    "WantedTopic",
]

_MAX_AGE_NS = 1_000_000_000
"""Age of the oldest published state. A program must notice the silence, as a CRTK client does after this time
(connection_timeout).
"""


class MessageSource(Protocol):
    """Source of a message at every period."""

    def cdr(self, stamp_ns: int) -> bytes | None:
        """Return the present message with this stamp; None if there is nothing to publish."""
        ...


class WantedSource(MessageSource, Protocol):
    """Source of messages while a program subscribes."""

    @property
    def present(self) -> bool:
        """Whether there is something to publish."""
        ...


class Arrivals:
    """When the last value of any state came, by the monotonic clock (ns); 0 before."""

    def __init__(self) -> None:
        self.newest_ns = 0

    @property
    def recent(self) -> bool:
        """Whether the simulation runs: a value came within a second."""
        return monotonic_ns() - self.newest_ns < _MAX_AGE_NS


class State:
    """The newest value of a signal from the simulation. Written by one thread, read by another.

    An unused state need not receive values, and keeps none: the next value could be much later.
    """

    def __init__(self, port: Port, arrivals: Arrivals | None = None) -> None:
        """`arrivals`: arrivals of all states of the gateway; None: arrivals of this state alone."""
        self.port = port
        self._codec = VectorCodec(port)
        self._arrivals = arrivals or Arrivals()
        self._newest: tuple[Vector, int] | None = None
        self.used = True
        self.writes = 0
        """Number of values so far."""

    def write(self, value: Vector) -> None:
        """Set the newest value."""
        now_ns = self._arrivals.newest_ns = monotonic_ns()
        if self.used:
            self._newest = value, now_ns
        self.writes += 1

    def use(self, *, used: bool) -> None:
        """Set whether values are used from now on."""
        if used != self.used:
            self._newest = None
            self.used = used

    @property
    def present(self) -> bool:
        """Whether there is a value not older than a second, or the state is unused."""
        return self.value is not None if self.used else bool(self.writes) and self._arrivals.recent

    @property
    def written_ns(self) -> int:
        """When the newest value was written, by the monotonic clock; 0 if none was."""
        return 0 if self._newest is None else self._newest[1]

    @property
    def value(self) -> Vector | None:
        """The newest value; None: no value within a second, or the state is unused."""
        newest = self._newest
        if newest is None or not self.used:
            return None
        return newest[0] if monotonic_ns() - newest[1] < _MAX_AGE_NS else None

    def cdr(self, stamp_ns: int) -> bytes | None:
        """Return the newest value as a message with this stamp; None if there is none."""
        value = self.value
        return None if value is None else self._codec.encode(value, stamp_ns)


class PeriodicTopic:
    """A topic published at the gateway's period, or at every n-th period."""

    def __init__(self, source: MessageSource, publish: Publisher, count: Count, every: int = 1) -> None:
        """`every`: number of periods between two messages."""
        self._source, self._publish, self._count, self._every = source, publish, count, every
        self._stamps = Stamps()

    def publish(self, period: int) -> None:
        """Publish the present message, if due in this period and available."""
        if period % self._every == 0 and (payload := self._source.cdr(self._stamps.next_ns())) is not None:
            self._publish(payload)
            self._count.messages += 1


class WantedTopic(PeriodicTopic):
    """A periodic topic with messages made only while a program subscribes.

    Messages without a subscriber are counted too: the reported rate is the rate for a subscriber.
    """

    def __init__(self, source: WantedSource, publish: Publisher, count: Count, every: int = 1) -> None:
        super().__init__(source, publish, count, every)
        self._wanted_source = source

    def publish(self, period: int) -> None:
        """Publish the present message, if due, available, and subscribed to."""
        if self._publish.wanted:
            super().publish(period)
        elif period % self._every == 0:
            self._count.messages += self._wanted_source.present


class EventTopic:
    """A topic with immediate publication of every message, in the writing thread."""

    def __init__(self, publish: Publisher, count: Count) -> None:
        self._publish, self._count, self._stamps = publish, count, Stamps()
        self._publishing = threading.Lock()

    def write(self, value: Value) -> None:
        """Publish a message, or several in their order, stamped now."""
        for message in value if isinstance(value, tuple) else (value,):
            if isinstance(message, Message):
                with self._publishing:
                    if self._publish.wanted:
                        self._publish(encode(stamp_message(message, self._stamps.next_ns())))
                    self._count.messages += 1


class Publications:
    """Thread publishing all states at the gateway's period, independent of the simulation's period."""

    def __init__(self, name: str, topics: Sequence[PeriodicTopic], period_ns: int) -> None:
        """Start to publish; `name`: the gateway's."""
        self._topics, self._period_ns = topics, period_ns
        self._ending = threading.Event()
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._run, name=f"gateway {name}", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        due_ns, period = monotonic_ns(), 0
        try:
            while not self._ending.wait(max(due_ns - monotonic_ns(), 0) / 1e9):
                for topic in self._topics:
                    topic.publish(period)
                period += 1
                # after a delay at most one period is made up for
                due_ns = max(due_ns + self._period_ns, monotonic_ns() - self._period_ns)
        except Exception as error:  # noqa: BLE001 - `check` raises it where the device is read
            self._failure = error

    def check(self) -> None:
        """Raise DeviceError if the thread has ended by an error."""
        if self._failure is not None:
            raise DeviceError(
                f"publishing has failed: {type(self._failure).__name__}: {self._failure}"
            ) from self._failure

    def close(self) -> None:
        """Stop publishing."""
        self._ending.set()
        if self._thread is not threading.current_thread():
            self._thread.join(timeout=2.0)
