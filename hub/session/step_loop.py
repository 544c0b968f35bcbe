"""The step loop of the hub: grants steps, does the hub's share, and waits for the acks of all others."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Collection
from time import monotonic, monotonic_ns, sleep

import zenoh

from hub.hosting.patience import Patience
from hub.observation.summary import Progress
from hub.planning.plan import PlannedParticipant
from hub.session.run import Run
from hub.session.run_profile import RunProfile
from hub.transport.publisher import Publisher
from schemas.lockstep import Ack, Grant, pack_grant

__all__ = ["OnAck", "StepLoop"]

log = logging.getLogger(__name__)

_PROGRESS_S = 0.1
_STATUS_S = 0.5
"""Everything so far goes to the recorder with a status."""
_RECORDED_TOGETHER = 64
"""Messages that go to the recorder before a status is due: a call costs as much as some ten messages."""
_VALUES_NS = 5_000_000_000
"""Longest time for values of the last steps over Zenoh after the arrival of the acks."""

OnAck = Callable[[PlannedParticipant, Ack], None]


class StepLoop:
    """Steps a run to the end; `on_ack` is called with every ack."""

    def __init__(self, run: Run, on_ack: OnAck | None) -> None:
        plan, session, keys = run.spec.plan, run.connection.session, run.connection.keys
        self._number = run.connection.number
        self._run, self._on_ack, self._past = run, on_ack, run.spec.past
        self._step_ns = plan.step_ns
        self._participants = plan.participants
        self._order = plan.order
        self._away = {name for name in plan.order if plan.participants[name].host != "hub"}
        self._common_period = math.lcm(*(plan.participants[name].period for name in plan.order))
        self._schedules: dict[tuple[int, int], tuple[list[str], dict[str, int]]] = {}
        self._unbooked: list[tuple[PlannedParticipant, Ack, bytes | None]] = []
        self._links = list(run.processes.links.values())
        others = any(plan.participants[name].host not in run.processes.links for name in self._away)
        self._grants = Publisher(
            session, keys.grant, zenoh.CongestionControl.BLOCK, lambda: None, always=others
        )
        self._energy = {
            bond.bond.name: Publisher(
                session,
                keys.energy(bond.bond.name),
                zenoh.CongestionControl.DROP,
                lambda: None,
                always=False,
            )
            for bond in plan.bonds
        }

    def show_to(self, profile: RunProfile) -> None:
        """Let a profile time this loop's own work."""
        profile.watch(self._run.host, self._run.devices, self._run.state)
        profile.watch_acks(self.book_acks, self._receive_acks, self._unbooked)

    def step_to_end(self, progress: Callable[[Progress], None] | None) -> None:
        """Step until all steps are done or the session is to end; raises the first failure of the run.

        `progress` is called ten times a second, and at the end.
        """
        run, clock, state = self._run, self._run.clock, self._run.state
        run.bookkeeping.start()
        shown = published = 0.0
        clock.start()
        while not clock.done and not state.ending:
            run.failure.check()
            budget = state.budget  # read once: control threads may change it at any time
            if budget == 0:
                self._wait_while_paused()
                continue
            grant = self._next_grant(budget)
            if grant is None:
                break
            self._step(grant)
            now = monotonic()
            if progress is not None and now - shown > _PROGRESS_S:
                shown = now
                progress(run.bookkeeping.progress())
            if now - published > _STATUS_S:
                published = now
                run.status.publish()
        run.bookkeeping.stop()
        run.acks.end(clock.step)
        self._wait_for_values()
        self.book_acks()
        if progress is not None:
            progress(run.bookkeeping.progress())

    def _wait_for_values(self) -> None:
        """Wait until the recorder and the measures have the values of the last steps."""
        patience = Patience(_VALUES_NS)
        while not self._run.monitor.has_received(self._run.clock.step):
            self._run.failure.check()
            if patience.is_over(self._run.processes.numbers):
                log.warning("values of the last steps have not arrived within %g s", _VALUES_NS / 1e9)
                return
            sleep(0.001)

    def _wait_while_paused(self) -> None:
        run = self._run
        self.book_acks()
        run.bookkeeping.phase = "paused"  # after the acks are booked: the status counts the steps taken
        run.status.publish()
        while not run.state.wait(0.2):
            for _ in run.acks.look():
                pass
            run.failure.check()
        run.bookkeeping.phase = "running"
        run.clock.start()

    def _next_grant(self, budget: int | None) -> Grant | None:
        """Return the next grant, of at most `budget` steps, with the samples entering there."""
        run = self._run
        if self._past is not None:
            then = next(self._past.grants, None)
            if then is not None:
                if self._past.live_from is not None:
                    run.devices.enter_samples(then.start_ns, then.step)  # they are where they were at its end
                return Grant(self._number, then.epoch, then.step, then.start_ns, then.horizon_ns, then.inlets)
            if run.clock.step != self._past.live_from:
                return None
            return self._first_live(self._past.new_devices)
        step, time_ns = run.clock.step, run.clock.time_ns
        horizon_ns = time_ns + run.clock.horizon(budget) * self._step_ns
        return Grant(self._number, 0, step, time_ns, horizon_ns, run.devices.enter_samples(time_ns, step))

    def _first_live(self, new_devices: Collection[str]) -> Grant:
        """Return the grant of a single step for the run to go on from the past."""
        run, self._past = self._run, None
        step, time_ns = run.clock.step, run.clock.time_ns
        run.clock.go_live()
        entering = run.devices.enter_samples(time_ns, step)
        entering = [one for one in entering if one.participant not in new_devices]
        entering += run.devices.inlets.restart(new_devices)
        log.info("live from %g s on", time_ns / 1e9)
        return Grant(self._number, 0, step, time_ns, time_ns + self._step_ns, entering)

    def _step(self, grant: Grant) -> None:
        """Give a grant, do the hub's share, and wait until all others have done theirs.

        The acks of the grant before are booked while remote processes work on this grant.
        """
        run = self._run
        granted_ns = monotonic_ns()
        due, steps = self._schedule(grant)
        run.watchdog.wait_for(due)
        payload = pack_grant(grant) if self._away or run.recorded else b""
        try:
            for link in self._links:
                link.send_grant(payload)
            if self._grants.needed:
                self._grants.put(payload)
            self.book_acks()
        finally:  # a failure may be raised at any moment: what was granted is in the recording
            if run.recorded:
                run.monitor.grant(grant, payload)
        run.host.run(grant, self._done_here)
        self._receive_acks([name for name in due if name in self._away], grant, steps)
        run.bookkeeping.count_answer_time(granted_ns)
        for participant, reason in run.host.ended.items():
            run.end(participant, reason)
        if run.clock.realtime:
            self.book_acks()  # now rather than when the next sample of a device waits
        count = (grant.horizon_ns - grant.start_ns) // self._step_ns
        run.clock.advance(count)
        run.state.spend(count)

    def _done_here(self, planned: PlannedParticipant, ack: Ack) -> None:
        self._unbooked.append((planned, ack, None))

    def _receive_acks(self, waiting: list[str], grant: Grant, steps: dict[str, int]) -> None:
        run = self._run
        run.watchdog.wait_for(waiting)
        while waiting:
            for accepted in run.acks.receive(waiting, grant, steps):
                waiting.remove(accepted[0].name)
                self._unbooked.append(accepted)
            if waiting:
                run.wire.take_arrived()  # a host may wait for room
            run.failure.check()
        run.watchdog.wait_for(())

    def _schedule(self, grant: Grant) -> tuple[list[str], dict[str, int]]:
        """Return the participants stepping in a grant, in step order, and their numbers of steps.

        Grants follow few patterns: each is worked out once.
        """
        begin, end = grant.step, grant.horizon_ns // self._step_ns
        key = begin % self._common_period, end - begin
        if key not in self._schedules:
            periods = {name: self._participants[name].period for name in self._order}
            steps = {name: (end - 1) // period - (begin - 1) // period for name, period in periods.items()}
            self._schedules[key] = [name for name in self._order if steps[name]], steps
        return self._schedules[key]

    def book_acks(self) -> None:
        """Book all arrived acks, and publish the energy books when due and of use."""
        monitor, bookkeeping = self._run.monitor, self._run.bookkeeping
        for planned, ack, payload in self._unbooked:
            monitor.ack(planned, ack, bookkeeping.book(planned, ack), payload)
            if self._on_ack is not None:
                self._on_ack(planned, ack)
        self._unbooked.clear()
        if self._run.recorded or any(publisher.needed for publisher in self._energy.values()):
            for bond, payload in monitor.due_energy_books(self._run.clock.time_ns).items():
                self._energy[bond].put(payload)
        monitor.record(_RECORDED_TOGETHER)
