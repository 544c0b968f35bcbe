"""A session: the hub's side of one run, from joining to summary."""

from __future__ import annotations

import logging
import math
import secrets
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from time import monotonic, monotonic_ns, sleep

import zenoh
from zenoh.handlers import Callback

from hub.devices.inlets import Inlets
from hub.devices.session_devices import Intake
from hub.hosting.host import Host
from hub.hosting.host_processes import Fleet, Watchdog
from hub.hosting.interrupt import Interrupt
from hub.observation.bookkeeping import Account
from hub.observation.measures import Measures
from hub.observation.observers import Observers
from hub.observation.summary import Progress, Summary
from hub.participant import Device, Stepped
from hub.planning.bond_check import check_bonds
from hub.planning.plan import Plan, PlannedParticipant
from hub.recording.recorder import Recorder
from hub.security.gate import Gate
from hub.session.acks import Acks
from hub.session.clock import Clock
from hub.session.control_server import ControlServer
from hub.session.membership import Failures, Membership
from hub.session.run_state import RunState
from hub.transport.endpoints import free_endpoint, require_loopback
from hub.transport.lane import may_spin
from hub.transport.refusals import Drops
from hub.transport.router_client import RouterClient
from hub.transport.wire import Wire
from hub.transport.zenoh_session import open_session
from schemas.codec import decode, encode
from schemas.errors import MessageError, ScenarioError, SessionError
from schemas.keys import Keys
from schemas.lockstep import Ack, Grant, pack_grant
from schemas.ros import StringMessage
from schemas.scenario import Scenario
from schemas.trocar_msgs import GrantMessage

__all__ = ["Session"]

log = logging.getLogger(__name__)

_PROGRESS_S = 0.1
_STATUS_S = 0.5


class Session:
    """One run of a scenario, with this process as hub and router."""

    def __init__(
        self,
        scenario: Scenario,
        plan: Plan,
        participants: Mapping[str, Stepped | Device],
        directory: Path,
        *,
        endpoint: str | None = None,
        gate: Gate | None = None,
        record: Path | None = None,
        attachments: Mapping[str, bytes] | None = None,
        grants: Iterator[GrantMessage] | None = None,
        on_ack: Callable[[PlannedParticipant, Ack], None] | None = None,
    ) -> None:
        """Prepare a run of `scenario`, wired as `plan` says, with those `participants` that live in this
        process.

        `directory`: where relative paths of the scenario start. `gate`: lets other machines in. `grants`:
        re-simulate these instead of listening to devices. `on_ack` sees what every participant reports of
        every grant.
        """
        self.scenario = scenario
        self.plan = plan
        self.endpoint = require_loopback(endpoint) if endpoint else free_endpoint()
        self.state = RunState()
        self._gate = gate
        self._participants = participants
        self._directory = directory
        self._record = record
        self._attachments = dict(attachments or {})
        self._grants = grants
        self._on_ack = on_ack
        self._run_id = secrets.randbits(63) | 1
        self._keys = Keys(scenario.name)
        steps = None if scenario.duration is None else max(1, round(scenario.duration / scenario.step))
        self._clock = Clock(plan, window=scenario.window, realtime=scenario.pace == "realtime", steps=steps)
        self._drops = Drops()
        self._inlets = Inlets(plan)
        self._intake = Intake(plan, self._keys, self._run_id, self._drops, self._inlets)
        self._away = {name for name in plan.order if plan.participants[name].host != "hub"}
        self._common_period = math.lcm(*(plan.participants[name].period for name in plan.order))
        self._schedules: dict[tuple[int, int], tuple[list[str], dict[str, int]]] = {}
        self._acks_to_book: list[tuple[PlannedParticipant, Ack, bytes | None]] = []
        self._interrupt = Interrupt()

    # --- the run
    # ---------------------------------------------------------------------------------------------------

    def run(self, progress: Callable[[Progress], None] | None = None) -> Summary:
        """Run to the end and return the summary. SIGTERM ends it as Ctrl-C does.

        Call it in the main thread: nowhere else can a participant of this process be interrupted that hangs
        or waits for a dead one.

        Raises ParticipantError or SessionError when the session fails (the recording is then closed and
        readable), ScenarioError if a bond's step is unstable, ConnectError if the endpoint is taken.
        """
        recorder = Recorder(self._record, attachments=self._attachments) if self._record is not None else None
        try:
            with self._interrupt, open_session("router", listen=[self.endpoint]) as session:
                self._observers = Observers(
                    self.plan, self._keys, self._run_id, Measures(self.scenario, self.plan), recorder
                )
                self._account = Account(
                    self.scenario,
                    self.plan,
                    self._run_id,
                    self._clock,
                    self._drops,
                    self._observers,
                    self._intake,
                )
                self._open(session)
                try:
                    if self._gate is not None:
                        self._gate.open(self.endpoint)
                    self._start_and_step(progress)
                    self._account.phase = "done"
                except SessionError as error:
                    self._account.detail = str(error)
                    # at once: it may take a while until all have closed
                    log.error("ending the session: %s", error)
                    raise
                finally:
                    self._close()
        finally:
            recorded = recorder.close() if recorder is not None else None
        return self._account.summary(recorded)

    def _start_and_step(self, progress: Callable[[Progress], None] | None) -> None:
        """Run, and let nothing interrupt what comes after: one failure brings others, which may be told at
        any moment.
        """
        try:
            try:
                self._start()
                self._loop(progress)
            finally:
                self._interrupt.disarm()
        except KeyboardInterrupt as interrupt:
            if isinstance(interrupt.__context__, SessionError | ScenarioError):  # it was on its way already
                raise interrupt.__context__ from None
            self._check()
            raise SessionError(f"interrupted at step {self._clock.step}") from None

    def _open(self, session: zenoh.Session) -> None:
        """Declare everything on `session`, and lay out what runs in this process."""
        keys = self._keys
        self._acks = Acks(session, keys, self.plan, self._run_id, self._drops)
        self._failures = Failures(wake=self._wake)
        self._membership = Membership(
            self.scenario,
            self.plan,
            self._directory,
            self._run_id,
            list(self._observers.away.values()),
            self._fail,
        )
        block, real_time, cdr = (
            zenoh.CongestionControl.BLOCK,
            zenoh.Priority.REAL_TIME,
            zenoh.Encoding.APPLICATION_CDR,
        )
        self._grant_publisher = session.declare_publisher(
            keys.grant, encoding=cdr, congestion_control=block, priority=real_time, express=True
        )
        self._status_publisher = session.declare_publisher(keys.status, encoding=cdr)
        self._energy_publishers = {
            b.bond.name: session.declare_publisher(keys.energy(b.bond.name), encoding=cdr)
            for b in self.plan.bonds
        }
        self._lay_local(session)
        watch = Callback(self._observers.sample, indirect=False)
        self._entities: list[zenoh.Subscriber[None] | zenoh.Queryable[None] | ControlServer] = [
            session.declare_queryable(keys.status, Callback(self._answer_status)),
            session.liveliness().declare_subscriber(keys.alive("*", "*"), Callback(self._came_or_went)),
            ControlServer(
                session,
                keys,
                self.state,
                self._inlets,
                self._intake.network_links,
                self._membership,
                self._drops,
            ),
            session.declare_subscriber(keys.refused("*", "*"), Callback(self._refused_elsewhere)),
            *(session.declare_subscriber(key, watch) for key in self._observers.away),
        ]
        self._token = session.liveliness().declare_token(keys.alive("hub", "hub"))
        self._fleet = Fleet()
        self._watchdog = Watchdog(
            self.plan, self._fleet, self.scenario.answer_limit, lambda: self._host.awaited, self._fail
        )

    def _lay_local(self, session: zenoh.Session) -> None:
        stepped = {name: p for name, p in self._participants.items() if isinstance(p, Stepped)}
        tap = self._observers.value if self._observers.watches_values else None
        wire = Wire(
            session, self._keys, self._run_id, self._drops, "hub", spin=may_spin(len(self.plan.hosts()))
        )
        self._host = Host("hub", self.plan, stepped, wire=wire, tap=tap)
        devices = (
            {n: p for n, p in self._participants.items() if isinstance(p, Device)}
            if self._grants is None
            else {}
        )
        for device in devices.values():
            if isinstance(device, RouterClient):
                device.learn_hub(lambda: open_session("client", connect=[self.endpoint]))
        self._intake.lay(session, devices, self._host.feeds, self._observers, self._fail)

    def _start(self) -> None:
        """Start the hosts, wait until all participants are configured and every link has carried a value."""
        hosts = [host for host in self.plan.hosts() if host != "hub" and self._is_needed(host)]
        for host in hosts:
            if not host.startswith("remote/"):
                self._fleet.start(host, self.endpoint, self.scenario.name)
        bonds = self._host.configure(self._directory)
        self._intake.open(self._directory)
        self._await_hosts(hosts)
        check_bonds(self.plan, {**bonds, **self._membership.bonds()})
        self._await_links()

    def _is_needed(self, host: str) -> bool:
        roles = {planned.role for planned in self.plan.participants.values() if planned.host == host}
        return self._grants is None or roles != {"device"}

    def _await_hosts(self, hosts: list[str]) -> None:
        limit_s = self.scenario.join_limit / 1e9
        doors = ", ".join((self.endpoint, *(self._gate.endpoints if self._gate is not None else ())))
        deadline = monotonic() + limit_s
        told: list[str] = []
        while missing := self._membership.missing(hosts):
            self._check()
            if self.state.ending:
                raise SessionError(f"shut down while waiting for {', '.join(missing)} to join")
            if missing != told:
                log.info("waiting for %s to join at %s", ", ".join(missing), doors)
            told = missing
            if monotonic() > deadline:
                raise SessionError(
                    f"{', '.join(missing)} did not join within {limit_s:g} s (join_limit) at {doors}"
                )

    def _await_links(self) -> None:
        waiting = [name for name in self.plan.order if name in self._away]
        self._watchdog.wait_for(waiting)
        while waiting or not self._host.linked() or not self._observers.linked():
            self._host.publish_initial()
            self._check()
            ready = self._acks.ready(waiting)
            if ready is None:
                sleep(0.005)
            else:
                waiting.remove(ready)
        self._watchdog.wait_for(())

    def _loop(self, progress: Callable[[Progress], None] | None) -> None:
        self._account.start()
        shown = told = 0.0
        self._clock.start()
        while not self._clock.done and not self.state.ending:
            self._check()
            budget = self.state.budget  # read once: control threads may change it at any time
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
                progress(self._account.progress())
            if now - told > _STATUS_S:
                told = now
                self._tell_status()
        self._account.stop()
        self._host.drain()
        self._settle()
        if progress is not None:
            progress(self._account.progress())

    def _wait_while_paused(self) -> None:
        self._settle()
        # after the reports are booked: a status that says so tells the steps taken
        self._account.phase = "paused"
        self._tell_status()
        while not self.state.wait(0.2):
            self._check()
        self._account.phase = "running"
        self._clock.start()

    def _next_grant(self, budget: int | None) -> Grant | None:
        """Return the next grant, of at most `budget` steps, with all that enters the simulation at this
        communication point.
        """
        if self._grants is not None:
            recorded = next(self._grants, None)
            if recorded is None:
                return None
            return Grant(
                self._run_id,
                recorded.epoch,
                recorded.step,
                recorded.start_ns,
                recorded.horizon_ns,
                recorded.inlets,
            )
        step, time_ns = self._clock.step, self._clock.time_ns
        horizon_ns = time_ns + self._clock.horizon(budget) * self.plan.step_ns
        return Grant(self._run_id, 0, step, time_ns, horizon_ns, self._intake.enter(time_ns, step))

    def _step(self, grant: Grant) -> None:
        """Publish a grant, take part in it, and wait until everybody else has.

        The reports of the grant before are booked while the others are at work on this one.
        """
        granted_ns = monotonic_ns()
        if self._away:
            self._grant_publisher.put(pack_grant(grant))
        self._settle()
        if self._record is not None:
            self._observers.grant(grant, pack_grant(grant))
        due, steps = self._schedule(grant)
        waiting = [name for name in due if name in self._away]
        self._watchdog.wait_for(due)
        self._host.run(grant, lambda planned, ack: self._acks_to_book.append((planned, ack, None)))
        self._watchdog.wait_for(waiting)
        while waiting:
            accepted = self._acks.receive(waiting, grant, steps)
            if accepted is None:
                self._check()
            else:
                waiting.remove(accepted[0].name)
                self._acks_to_book.append(accepted)
        self._watchdog.wait_for(())
        self._account.acknowledged(granted_ns)
        if self._clock.realtime:
            self._settle()  # now rather than when the next sample of a device waits
        count = (grant.horizon_ns - grant.start_ns) // self.plan.step_ns
        self._clock.advance(count)
        self.state.spend(count)

    def _schedule(self, grant: Grant) -> tuple[list[str], dict[str, int]]:
        """Return who steps in a grant, in step order, and how often; grants come in few patterns, so each is
        worked out once.
        """
        begin, end = grant.step, grant.horizon_ns // self.plan.step_ns
        key = begin % self._common_period, end - begin
        if key not in self._schedules:
            periods = {name: self.plan.participants[name].period for name in self.plan.order}
            steps = {name: (end - 1) // period - (begin - 1) // period for name, period in periods.items()}
            self._schedules[key] = [name for name in self.plan.order if steps[name]], steps
        return self._schedules[key]

    def _settle(self) -> None:
        """Book the reports that have come in, and publish the energy books when they are due."""
        for planned, ack, payload in self._acks_to_book:
            self._take(planned, ack, payload)
        self._acks_to_book.clear()
        for message in self._observers.books(self._clock.time_ns):
            self._energy_publishers[message.bond].put(encode(message))

    def _take(self, planned: PlannedParticipant, ack: Ack, payload: bytes | None) -> None:
        """Book what a participant reports: its hashes, its last step, the work of its bonds."""
        self._observers.ack(planned, ack, self._account.book(planned, ack), payload)
        if self._on_ack is not None:
            self._on_ack(planned, ack)

    def _close(self) -> None:
        """End processes and close everything; the hosts end when the hub's token is gone."""
        self._settle()
        if self._account.phase != "done":
            self._account.phase = "failed"
        self._tell_status()
        self._watchdog.end()
        self._token.undeclare()
        if self._gate is not None:
            self._gate.close()
        self._intake.close()
        self._host.close()
        self._fleet.end()
        for entity in self._entities:
            entity.undeclare()

    # --- what others report and ask
    # --------------------------------------------------------------------------------

    def _fail(self, participant: str, cause: str) -> None:
        """End the run because of `participant`; may be called from any thread."""
        here = self.plan.participants[participant].host == "hub"  # of another host only the grant is known
        self._failures.report(
            participant, max(self._clock.step, self._host.step) if here else self._clock.step, cause
        )

    def _wake(self) -> None:
        """Make the step loop look at the failures: it may wait for acks, or be inside a participant of this
        process.
        """
        self._acks.wake()
        self._interrupt()

    def _check(self) -> None:
        """Raise the first failure, if there is one: in the words of a participant, if they are here already;
        else an interrupt that got lost.
        """
        if self._failures.first is None:
            self._interrupt.check()
            return
        self._acks.raise_failure()
        self._failures.check()

    def _came_or_went(self, sample: zenoh.Sample) -> None:
        """Take note that a liveliness token came or went.

        A lost engine ends the run; a lost device makes its arm hold.
        """
        name = str(sample.key_expr).rsplit("/", 1)[1]
        planned = self.plan.participants.get(name)
        if planned is None or not planned.host.startswith("remote/"):
            return
        if sample.kind != zenoh.SampleKind.DELETE:
            if planned.role == "device":
                self._intake.network_links.repeat(name)
            return
        self._membership.lose(planned.host)
        if planned.role == "device":
            self._intake.forget(name)
        if self._account.phase not in ("starting", "running", "paused"):
            return
        if planned.role == "device":
            log.warning(
                "device '%s' is gone, what it leads holds: start 'trocar device %s' again, or mend the"
                " network; a host that still runs joins again",
                name,
                name,
            )
        else:
            self._fail(name, "its host is gone")

    def _refused_elsewhere(self, sample: zenoh.Sample) -> None:
        """Count what another host had to drop; it has logged why."""
        try:
            decode(StringMessage, sample.payload.to_bytes())
            self._drops.add(str(sample.key_expr))
        except MessageError as error:
            self._drops.count(sample, error)

    def _answer_status(self, query: zenoh.Query) -> None:
        with query:
            query.reply(
                self._keys.status,
                encode(self._account.status(self._membership.pid)),
                encoding=zenoh.Encoding.APPLICATION_CDR,
            )

    def _tell_status(self) -> None:
        status = self._account.status(self._membership.pid)
        self._observers.status(status)
        self._status_publisher.put(encode(status))
