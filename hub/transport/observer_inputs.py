"""Inputs of an observer: the newest complete state of the simulation, never a queue of states."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import zenoh
from zenoh.handlers import Callback

from hub.planning.plan import ConnectionToDevice, Plan
from hub.transport.bundle import bundled_connections, unpack_bundle
from hub.transport.cells import INITIAL
from hub.transport.envelope import Tag
from hub.transport.port_codec import PortCodec
from hub.transport.run_connection import RunConnection
from schemas.errors import MessageError

__all__ = ["ObserverInputs", "State"]

_KEPT = 8
"""Number of values kept of an input: the inputs of a state arrive one after another."""


class State(NamedTuple):
    """The inputs of an observer at a moment."""

    time_ns: int
    """Time of the newest value."""
    values: dict[str, Any]
    """Values by input port."""
    sent_ns: int
    """Time at which the last value was sent, by the monotonic clock of the sending host."""
    missed: int
    """States complete since the last call and not returned."""


class _Value(NamedTuple):
    time_ns: int
    payload: bytes
    sent_ns: int


class ObserverInputs:
    """Receives the bundles for an observer, until closed.

    Args:
        run: The connection to the run.
        name: The observer.
        arrived: Is called, in any thread, when something has arrived.
    """

    def __init__(self, run: RunConnection, name: str, arrived: Callable[[], None]) -> None:
        plan = run.plan
        self._name, self._run, self._arrived = name, run, arrived
        self._period_ns = plan.participants[name].period * plan.step_ns
        self._lock = threading.Lock()
        self._seen_ns: int | None = None
        """The time of the last state; None before the first."""
        self._inputs: list[_Input] = []
        self._subscribers: list[zenoh.Subscriber[None]] = []
        outlets = [outlet for outlet in plan.to_devices if outlet.target == name]
        for source in dict.fromkeys(outlet.source for outlet in outlets):
            inputs = [_Input(plan, outlet) for outlet in bundled_connections(plan, source, name)]
            self._inputs += inputs
            receive = Callback(partial(self._receive, inputs), indirect=False)
            self._subscribers.append(run.session.declare_subscriber(run.keys.signals(source, name), receive))
        self._spacing_ns = max(self._period_ns, min(one.stride_ns for one in self._inputs))
        """Simulated time between two states."""

    def _receive(self, inputs: list[_Input], sample: zenoh.Sample) -> None:
        try:
            tag = Tag.of(sample)
            if tag.run != self._run.number:
                raise MessageError(f"belongs to run {tag.run:x}, this is run {self._run.number:x}")
            with self._lock:
                for index, payload in unpack_bundle(sample.payload.to_bytes()):
                    if index >= len(inputs):
                        raise MessageError(f"a bundle has value {index} of {len(inputs)}")
                    inputs[index].keep(tag, payload)
        except MessageError as error:
            self._run.refusals.refuse_sample(sample, error)
            return
        self._arrived()

    def pop_newest(self) -> State | None:
        """Return the newest complete state, unless returned before; the first is the state at time 0.

        Complete means: of every input, the value that holds at a multiple of the period has arrived.
        """
        with self._lock:
            chosen = self._first() if self._seen_ns is None else self._newest()
            time_ns = max((value.time_ns for value in chosen), default=-1)
            missed, seen_ns = 0, self._seen_ns
            if seen_ns is not None:
                missed = max((time_ns - seen_ns) // self._spacing_ns - 1, 0)
            if time_ns <= (-1 if seen_ns is None else seen_ns):
                return None
            self._seen_ns = time_ns
        try:
            values = {
                one.port: one.codec.unpack(value.payload)
                for one, value in zip(self._inputs, chosen, strict=True)
            }
        except MessageError as error:
            self._run.refusals.refuse(f"inputs of '{self._name}'", error)
            return None
        return State(time_ns, values, max(value.sent_ns for value in chosen), missed)

    def miss_none(self) -> None:
        """Count no earlier state as missed: the observer has just joined."""
        with self._lock:
            newest_ns = max(value.time_ns for value in self._newest())
            self._seen_ns = max(self._seen_ns or 0, newest_ns - self._spacing_ns)

    def _first(self) -> list[_Value]:
        """Return the values at time 0, or nothing until all have arrived."""
        first = [one.first for one in self._inputs if one.first is not None]
        return first if len(first) == len(self._inputs) else []

    def _newest(self) -> list[_Value]:
        until_ns = min(one.recent[-1].time_ns + one.stride_ns for one in self._inputs)
        complete_ns = (until_ns - 1) // self._period_ns * self._period_ns
        return [one.at(complete_ns) for one in self._inputs]

    def close(self) -> None:
        """Receive no more."""
        for subscriber in self._subscribers:
            subscriber.undeclare()


class _Input:
    """A connection to the observer, and the last values received over the connection."""

    def __init__(self, plan: Plan, outlet: ConnectionToDevice) -> None:
        source = plan.participants[outlet.source]
        self.codec = PortCodec(source.port(outlet.source_port))
        self.port = outlet.target_port
        self.stride_ns = plan.output_stride(source.name, outlet.source_port) * plan.step_ns
        self.first: _Value | None = None
        self.recent: deque[_Value] = deque(maxlen=_KEPT)

    def keep(self, tag: Tag, payload: bytes) -> None:
        """Keep a value unless old: the value at time 0 is repeated until the session begins."""
        value = _Value(tag.time_ns, payload, tag.sent_ns)
        if tag.step == INITIAL and self.first is None:
            self.first = value
        if not self.recent or value.time_ns > self.recent[-1].time_ns:
            self.recent.append(value)

    def at(self, time_ns: int) -> _Value:
        """Return the value at `time_ns`, or the oldest value kept."""
        return next((value for value in reversed(self.recent) if value.time_ns <= time_ns), self.recent[0])
