"""The profile of a run: use of time in every process, and causes of late steps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from time import monotonic_ns

import zenoh
from zenoh.handlers import Callback

from hub.devices.session_devices import SessionDevices
from hub.hosting.host import Host
from hub.hosting.process_profile import ProcessProfile
from hub.observation.late_steps import NO_CORE, LateSteps
from hub.observation.monitor import Monitor
from hub.observation.stopwatch import Phase
from hub.observation.thread_clocks import CoreQueue
from hub.participant import Stepped
from hub.planning.plan import PlannedParticipant
from hub.session.clock import Clock
from hub.session.run_state import RunState
from hub.transport.run_connection import RunConnection
from hub.transport.wire import Wire
from schemas.codec import decode, encode
from schemas.errors import MessageError
from schemas.lockstep import Ack
from schemas.trocar_msgs import Profile, ProfileRow

__all__ = ["RunProfile"]

_ANSWER_S = 1.0
"""Longest time for the answer of a host; a host computing in a library without releasing the interpreter
answers only afterwards.
"""


class RunProfile:
    """Times the step loop of the hub, asks the hosts for their parts, and answers queries with the whole.

    The timed objects do not know of the profile: methods are replaced on their objects before the first step.

    Args:
        run: The hub's connection to the run.
        clock: The clock of the run.
        monitor: Records and measures the run.
    """

    def __init__(self, run: RunConnection, clock: Clock, monitor: Monitor) -> None:
        self._run, self._clock, self._monitor = run, clock, monitor
        self.process = ProcessProfile("hub", run.plan, Phase("hub", "hub"))
        self._wall_clock = self.process.watch.phase("waiting for the wall clock", "hub")
        self._late = LateSteps()
        self._computed_ns: dict[str, int] = {}
        """Computing time (ns) by participant of another host, in the last grant."""
        self._began_ns = monotonic_ns()
        self._waited_ns = 0
        self._queue: CoreQueue | None = None
        self._late_steps = self._time_ns = 0
        self._queryable = run.session.declare_queryable(run.keys.profile, Callback(self._answer))

    def prepare(self, stepped: Mapping[str, Stepped], wire: Wire) -> None:
        """Time participants, arriving values, and the recording; call this before making a Host."""
        self.process.prepare(stepped, wire)
        recording = self.process.watch.phase("recording", "recorder")
        for method in (self._monitor.grant, self._monitor.record, self._monitor.status):
            self.process.watch.time(method, recording)
        for method in (self._monitor.listener, self._monitor.vectors_listener):
            self.process.watch.time_returned(method, recording)

    def watch(self, host: Host, devices: SessionDevices, state: RunState) -> None:
        """Time the parts of a run used by the step loop."""
        watch = self.process.watch
        self.process.attach(host)
        watch.time(devices.enter_samples, watch.phase("devices", "devices"))
        watch.time(state.wait, watch.phase("paused", "hub"))
        watch.time_by_result(self._clock.advance, self._wall_clock, self._judge_steps)

    def watch_acks(
        self,
        book: Callable[[], None],
        receive: Callable[..., None],
        unbooked: Sequence[tuple[PlannedParticipant, Ack, bytes | None]],
    ) -> None:
        """Time the booking of acks, and the wait for the acks of remote hosts, which are then `unbooked`.

        Among several hosts, the wait was for the host whose participants have computed longest.
        """
        watch = self.process.watch
        waiting = watch.phase("hub", "hub")

        def received(_: None) -> Phase:
            away = [(planned, sum(ack.compute_ns)) for planned, ack, _ in unbooked if planned.host != "hub"]
            self._computed_ns = {planned.name: computed_ns for planned, computed_ns in away}
            hosts: Counter[str] = Counter()
            for planned, computed_ns in away:
                hosts[planned.host] += computed_ns
            return self.process.waiting_for(host for host, _ in hosts.most_common(1)) if away else waiting

        watch.time(book, watch.phase("booking", "hub"))
        watch.time_by_result(receive, waiting, received)

    def start(self) -> None:
        """Count from now: the first step begins, and the calling thread is the stepping thread."""
        self._began_ns = monotonic_ns()
        self._queue = CoreQueue()
        self._waited_ns = self._queue.waited_ns()
        self.process.restart()

    def _judge_steps(self, _: None) -> Phase:
        """Judge the steps of a grant, if late, and begin the next round."""
        watch, clock = self.process.watch, self._clock
        late, self._late_steps = clock.late_steps - self._late_steps, clock.late_steps
        simulated_ns, self._time_ns = clock.time_ns - self._time_ns, clock.time_ns
        if self._queue is not None and clock.realtime:
            waited_ns = self._queue.waited_ns()
            if late:
                causes = self._split_causes(watch.round_ns(), waited_ns - self._waited_ns)
                self._late.add(late, simulated_ns, clock.time_ns, causes)
            self._waited_ns = waited_ns
        watch.next_round()
        return self._wall_clock

    def _split_causes(self, phases: dict[Phase, int], no_core_ns: int) -> dict[str, int]:
        """Return the wall time (ns) of a grant by cause.

        The wait for a host is due to the participants there, as far as the participants computed. The time of
        the hub's thread without a core is subtracted from the longest phase, in which most of it must have
        been.
        """
        causes = {phase.name: ns for phase, ns in phases.items() if ns and phase is not self._wall_clock}
        for name, computed_ns in self._computed_ns.items():
            host = self._run.plan.participants[name].host
            waited = self.process.waiting_for([host]).name
            due_ns = min(computed_ns, causes.get(waited, 0))
            if due_ns:
                causes[waited] -= due_ns
                causes[f"participant {name} (host {host})"] = due_ns
        longest = max(causes, key=lambda cause: causes[cause], default="hub")
        no_core_ns = min(no_core_ns, causes.get(longest, 0))
        if no_core_ns > 0:
            causes[longest] -= no_core_ns
            causes[NO_CORE] = no_core_ns
        return causes

    def message(self) -> Profile:
        """Return the profile so far; from any thread except Zenoh's callbacks."""
        return Profile(
            session=self._run.keys.session,
            run=self._run.number,
            sim_time_ns=self._clock.time_ns,
            wall_time_ns=monotonic_ns() - self._began_ns,
            steps=self._clock.step,
            rows=[*self.process.rows(), *self._rows_of_hosts()],
            late=self._late.cause_counts,
            worst=self._late.worst_steps,
        )

    def _rows_of_hosts(self) -> list[ProfileRow]:
        rows: list[ProfileRow] = []
        for reply in self._run.session.get(self._run.keys.host_profile("*"), timeout=_ANSWER_S):
            if reply.ok is None:
                continue
            try:
                profile = decode(Profile, reply.ok.payload.to_bytes())
                if profile.run != self._run.number:
                    raise MessageError(f"belongs to run {profile.run:x}, this is run {self._run.number:x}")
                rows += profile.rows
            except MessageError as error:
                self._run.refusals.refuse_sample(reply.ok, error)
        return rows

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            answer = encode(self.message())
            query.reply(self._run.keys.profile, answer, encoding=zenoh.Encoding.APPLICATION_CDR)

    def finish(self) -> Profile:
        """Return and record the profile of the whole run; the hosts are still there."""
        profile = self.message()
        self._monitor.profile(profile)
        return profile

    def undeclare(self) -> None:
        """Answer no more."""
        self._queryable.undeclare()
        if self._queue is not None:
            self._queue.close()
