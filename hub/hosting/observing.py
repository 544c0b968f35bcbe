"""The observers of a process look at the newest state in turn, each at the observer's own rate."""

from __future__ import annotations

import threading
from collections.abc import Callable
from time import monotonic, monotonic_ns, perf_counter
from typing import NoReturn

import zenoh

from hub.hosting.host import Host
from hub.observation.latency import Latencies
from hub.planning.plan import Plan
from hub.transport.observer_inputs import ObserverInputs, State
from hub.transport.run_connection import RunConnection
from schemas.codec import encode
from schemas.trocar_msgs import ObserverStatus

__all__ = ["Observing"]

_STATUS_S = 1.0


class Observing:
    """Steps the observers of a host as states arrive; a state arriving during a look is dropped.

    Args:
        host: The host, with observers alone.
        run: The connection to the run.
    """

    def __init__(self, host: Host, run: RunConnection) -> None:
        self._arrived = threading.Event()
        self._observers = [
            _Observer(
                planned.name,
                host,
                ObserverInputs(run, planned.name, self._arrived.set),
                run.session.declare_publisher(
                    run.keys.observer_status(planned.name), encoding=zenoh.Encoding.APPLICATION_CDR
                ),
            )
            for planned in host.participants
        ]

    def serve(self, began: Callable[[], None]) -> NoReturn:
        """Look until the process is interrupted; `began` is called when each has seen the state at time 0.

        Raises ParticipantError.
        """
        waiting = list(self._observers)
        while waiting:
            self._wait()
            waiting = [one for one in waiting if not one.look()]
        for one in self._observers:
            one.begin()
        began()
        while True:
            self._wait()
            for one in self._observers:
                one.look()
                one.report()

    def _wait(self) -> None:
        self._arrived.wait(_STATUS_S)
        self._arrived.clear()

    def close(self) -> None:
        """Report a last time and receive no more."""
        for one in self._observers:
            one.close()


class _Observer:
    """An observer and the observer's counts."""

    def __init__(self, name: str, host: Host, inputs: ObserverInputs, status: zenoh.Publisher) -> None:
        self._name, self._host, self._inputs, self._publisher = name, host, inputs, status
        self._plan: Plan = host.plan
        remote = {self._plan.participants[name].host.startswith("remote/")}
        sources = {one.source for one in self._plan.to_devices if one.target == name}
        remote |= {self._plan.participants[source].host.startswith("remote/") for source in sources}
        self._timed = remote == {False}  # no clock of another machine is known here
        self._latencies = Latencies()
        self._began_s = self._seen_s = self._reported_s = 0.0
        self._step = -1
        self._states = self._dropped = 0
        self._busy_s = 0.0

    def begin(self) -> None:
        """Count from now: everything before was the start."""
        self._inputs.miss_none()
        self._began_s = self._seen_s = monotonic()
        self._states, self._busy_s = 0, 0.0

    def look(self) -> bool:
        """Step the observer with the newest state, if new; return whether a new state has arrived."""
        state = self._inputs.pop_newest()
        if state is None:
            return False
        begun_s = perf_counter()
        self._host.observe(self._name, state.time_ns, state.values)
        self._busy_s += perf_counter() - begun_s
        self._count(state)
        return True

    def _count(self, state: State) -> None:
        self._step = state.time_ns // self._plan.step_ns
        self._states += 1
        self._dropped += state.missed
        self._seen_s = monotonic()
        if self._timed and self._began_s:
            self._latencies.add("state to picture", self._name, monotonic_ns() - state.sent_ns)

    def report(self, *, now: bool = False) -> None:
        """Publish the observer's status when due, or `now`."""
        if not now and monotonic() - self._reported_s < _STATUS_S:
            return
        self._reported_s = monotonic()
        elapsed_s = self._seen_s - self._began_s
        status = ObserverStatus(
            observer=self._name,
            step=self._step,
            states=self._states,
            dropped=self._dropped,
            rate=self._states / elapsed_s if elapsed_s else 0.0,
            attainable_rate=self._states / self._busy_s if self._busy_s else 0.0,
            latencies=self._latencies.messages(),
        )
        self._publisher.put(encode(status))

    def close(self) -> None:
        """Report the status a last time, and receive no more."""
        self.report(now=True)
        self._inputs.close()
        self._publisher.undeclare()
