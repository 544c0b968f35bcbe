"""The first failure of a run ends the run: later failures are consequences."""

from __future__ import annotations

import threading

from hub.hosting.host import Host
from hub.hosting.interrupt import Interrupt
from hub.planning.plan import Plan
from hub.session.ack_receiver import AckReceiver
from hub.session.clock import Clock
from schemas.errors import ParticipantError

__all__ = ["FirstFailure"]


class FirstFailure:
    """Keeps the first failure reported by any thread; the step loop raises this failure."""

    def __init__(self, plan: Plan, clock: Clock, host: Host, acks: AckReceiver, interrupt: Interrupt) -> None:
        self._plan, self._clock, self._host, self._acks, self._interrupt = plan, clock, host, acks, interrupt
        self._lock = threading.Lock()
        self._first: ParticipantError | None = None

    def report(self, participant: str, cause: str) -> None:
        """Report the failure of `participant`; from any thread."""
        step = self._clock.step
        if self._plan.participants[participant].host == "hub":  # of another host only the grant is known
            step = max(step, self._host.step)
        with self._lock:
            if self._first is not None:
                return
            self._first = ParticipantError(participant, step, cause)
        # the step loop may wait for acks, or be inside a participant of this process
        self._acks.wake()
        self._interrupt()

    def check(self) -> None:
        """Raise the first failure, if any; else an interrupt swallowed by a callback.

        Where the participant itself has reported the cause, the participant's report is raised instead.
        """
        if self._first is None:
            self._interrupt.check()
            return
        self._acks.raise_failure()
        raise self._first
