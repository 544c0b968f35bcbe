"""A session: the hub's side of one run, from joining to summary."""

from __future__ import annotations

import hashlib
import logging
import secrets
import struct
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from time import monotonic, monotonic_ns, sleep
from typing import Any

import zenoh
from zenoh.handlers import Callback, FifoChannel

from hub.clock import Clock
from hub.control import ControlServer, Empty, JoinReply, JoinRequest, RunState, SetRequest, StepRequest
from hub.coupling import stable_step_problem
from hub.devices import DeviceLoop, ScriptedDevices, follows_clock
from hub.endpoint import free_endpoint
from hub.fleet import Fleet, Watchdog
from hub.host import Host
from hub.inlets import Inlets
from hub.measures import Measures
from hub.observers import Observers
from hub.participant import Device, Stepped
from hub.plan import Member, Plan
from hub.recorder import Recorder, RecorderSummary
from hub.wire import Drops, PortCodec, Wire, open_session
from schemas.codec import encode, message_type
from schemas.errors import MessageError, ParticipantError, ScenarioError, SessionError
from schemas.keys import Keys
from schemas.lockstep import Permission, Report, pack_permission, pack_report, unpack_report
from schemas.ports import BondSide
from schemas.scenario import Scenario
from schemas.trocar_msgs import Grant, ParticipantStatus, SessionStatus

__all__ = ["Progress", "Session", "Summary"]

log = logging.getLogger(__name__)

_PROGRESS_S = 0.1
_STATUS_S = 0.5


@dataclass(frozen=True)
class Progress:
    """What a progress line shows."""

    step: int
    steps: int | None
    sim_time_s: float
    real_time_factor: float
    late_steps: int
    live: Mapping[str, tuple[float, str]]


@dataclass
class Summary:
    """What a run was like."""

    session: str
    state: str
    steps: int
    sim_time_s: float
    wall_time_s: float
    real_time_factor: float
    late_steps: int
    dropped_messages: int
    state_hash: str
    """Over every state hash of every participant: equal for equal runs, whatever the placement or the grants' windows."""
    recording: str | None
    recording_complete: bool | None
    energy_residual_j: float
    measures: dict[str, float | None] = field(default_factory=dict[str, float | None])

    def as_dict(self) -> dict[str, Any]:
        """Return the summary as JSON would have it, the measures beside the rest."""
        row = asdict(self)
        return {**{k: v for k, v in row.items() if k != "measures"}, **row["measures"]}


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
        record: Path | None = None,
        attachments: Mapping[str, bytes] | None = None,
        grants: Iterator[Grant] | None = None,
        on_report: Callable[[Member, Report], None] | None = None,
    ) -> None:
        """Prepare a run of `scenario`, wired as `plan` says, with those `participants` that live in this process.

        `directory`: where relative paths of the scenario start. `grants`: re-simulate these instead of listening to devices.
        `on_report` sees every report as it comes.
        """
        self.scenario = scenario
        self.plan = plan
        self.endpoint = endpoint or free_endpoint()
        self.state = RunState()
        self._participants = participants
        self._directory = directory
        self._record = record
        self._attachments = dict(attachments or {})
        self._grants = grants
        self._on_report = on_report
        self._run_id = secrets.randbits(63) | 1
        self._keys = Keys(scenario.name)
        steps = None if scenario.duration is None else max(1, round(scenario.duration / scenario.step))
        self._clock = Clock(plan, window=scenario.window, realtime=scenario.pace == "realtime", steps=steps)
        self._steps = steps
        self._inlets = Inlets(plan)
        self._digests = {name: hashlib.blake2b(digest_size=16) for name in plan.order}
        self._done: dict[str, int] = dict.fromkeys(plan.order, -1)
        self._joined: dict[str, JoinRequest] = {}
        self._join_changed = threading.Condition()
        self._phase = "starting"
        self._failure = ""
        self._wall_ns = 0

    # --- the run ---------------------------------------------------------------------------------------------------

    def run(self, progress: Callable[[Progress], None] | None = None) -> Summary:
        """Run to the end and return the summary.

        Raises ParticipantError or SessionError when the session fails (the recording is then closed and readable),
        ScenarioError if a bond's step is unstable, ConnectError if the endpoint is taken.
        """
        recorder = Recorder(self._record, attachments=self._attachments) if self._record is not None else None
        try:
            with open_session("router", listen=[self.endpoint]) as session:
                self._observers = Observers(self.plan, self._keys, self._run_id, Measures(self.scenario, self.plan), recorder)
                self._open(session)
                try:
                    self._start()
                    self._loop(progress)
                    self._phase = "done"
                except KeyboardInterrupt:
                    raise self._interrupted() from None
                except BaseException as error:
                    self._failure = str(error)
                    raise
                finally:
                    self._phase = "done" if self._phase == "done" else "failed"
                    self._close()
        finally:
            recorded = recorder.close() if recorder is not None else None
        return self._summary(recorded)

    def _interrupted(self) -> SessionError:
        """Return what a keyboard interrupt means: Ctrl-C, or the watchdog's way out of a participant that hangs in this process."""
        error: SessionError = ParticipantError(*self._hung) if self._hung else SessionError(f"interrupted at step {self._clock.step}")
        self._failure = str(error)
        return error

    def _open(self, session: zenoh.Session) -> None:
        """Declare everything on `session`, make the local host, and start the processes."""
        self._session = session
        self._hung: tuple[str, int, str] | None = None
        self._drops = Drops()
        self._fleet = Fleet()
        self._acks = session.declare_subscriber(self._keys.ack("*"), FifoChannel(4096))
        self._by_ack = {self._keys.ack(name): self.plan.members[name] for name in self.plan.order}
        self._own_acks = {name: session.declare_publisher(self._keys.ack(name)) for name in self.plan.order}
        settings: dict[str, Any] = {"congestion_control": zenoh.CongestionControl.BLOCK, "priority": zenoh.Priority.REAL_TIME, "express": True}
        self._grant_publisher = session.declare_publisher(self._keys.grant, encoding=zenoh.Encoding.APPLICATION_CDR, **settings)
        self._status_publisher = session.declare_publisher(self._keys.status, encoding=zenoh.Encoding.APPLICATION_CDR)
        self._energy_publishers = {b.bond.name: session.declare_publisher(self._keys.energy(b.bond.name)) for b in self.plan.bonds}
        self._status_queryable = session.declare_queryable(self._keys.status, Callback(self._answer_status, indirect=True))
        watch = Callback(self._observers.sample, indirect=False)
        self._taps: list[zenoh.Subscriber[None]] = [session.declare_subscriber(key, watch) for key in self._observers.subscriptions(self.plan)]
        if self._grants is None:
            sources = sorted({(inlet.device, inlet.device_port) for inlet in self.plan.inlets})
            take = Callback(self._device_sample, indirect=False)
            self._taps += [session.declare_subscriber(self._keys.output("device", *source), take) for source in sources]
        self._control = ControlServer(session, self._keys, self._handlers())
        self._token = session.liveliness().declare_token(self._keys.alive("hub", "hub"))
        self._watchdog = Watchdog(self.plan, self._fleet, self.scenario.answer_limit, self._fail)
        self._lay_local()

    def _lay_local(self) -> None:
        stepped = {name: p for name, p in self._participants.items() if isinstance(p, Stepped)}
        self._host = Host("hub", self.plan, stepped, wire=Wire(self._session, self._keys, self._run_id), tap=self._observers.value if self._observers.watches_values else None)
        self._remote = [name for name in self.plan.order if self.plan.members[name].host != "hub"]
        devices = {n: p for n, p in self._participants.items() if isinstance(p, Device)} if self._grants is None else {}
        self._scripted = ScriptedDevices({n: d for n, d in devices.items() if follows_clock(self.plan.members[n])})
        loops = {n: d for n, d in devices.items() if not follows_clock(self.plan.members[n])}
        self._loops = [DeviceLoop(self.plan.members[n], self.plan, d, self._session, self._keys, failed=self._fail) for n, d in loops.items()]

    def _start(self) -> None:
        """Start the hosts, wait until all participants are configured and every link has carried a value."""
        hosts = [host for host in self.plan.hosts() if host != "hub" and self._is_needed(host)]
        for host in hosts:
            if not host.startswith("remote/"):
                self._fleet.start(host, self.endpoint, self.scenario.name)
        bonds = self._host.configure(self._directory)
        self._scripted.open(self._directory)
        for loop in self._loops:
            loop.start(self._directory)
        self._await_hosts(hosts)
        for request in self._joined.values():
            bonds |= request.bonds
        self._check_steps(bonds)
        self._await_links()

    def _is_needed(self, host: str) -> bool:
        roles = {member.role for member in self.plan.members.values() if member.host == host}
        return self._grants is None or roles != {"device"}

    def _await_hosts(self, hosts: Sequence[str]) -> None:
        deadline = monotonic() + self.scenario.join_limit / 1e9
        told = ""
        while True:
            missing = [host for host in hosts if host not in self._joined or not self._joined[host].ready]
            if not missing:
                return
            self._raise_failures()
            waiting = ", ".join(missing)
            if waiting != told:
                told = waiting
                log.info("waiting for %s to join at %s", waiting, self.endpoint)
            if monotonic() > deadline:
                raise SessionError(f"{waiting} did not join within {self.scenario.join_limit / 1e9:g} s (join_limit) at {self.endpoint}")
            with self._join_changed:
                self._join_changed.wait(0.05)

    def _raise_failures(self) -> None:
        """Raise what hosts and the watchdog have reported while nobody waited for acks."""
        for request in self._joined.values():
            if request.failed:
                participant, _, cause = request.failed.partition(": ")
                raise ParticipantError(participant, -1, cause)
        while (sample := self._acks.try_recv()) is not None:
            self._accept(sample, [])

    def _check_steps(self, bonds: Mapping[str, Sequence[BondSide]]) -> None:
        for index, planned in enumerate(self.plan.bonds):
            bond = planned.bond
            motion, force = (
                next(side for side in bonds[end.participant] if side.name == end.port) for end in (bond.motion, bond.force)
            )
            step_s = self.plan.members[bond.force.participant].period * self.plan.step_ns / 1e9
            problem = stable_step_problem(bond, motion, force, step_s)
            if problem and bond.check == "refuse":
                raise ScenarioError(f"{problem} To run all the same, set 'check: warn' on the bond.", path=("bonds", index))
            if problem:
                log.warning("bond %s: %s", bond.name, problem)

    def _await_links(self) -> None:
        waiting = list(self._remote)
        self._watchdog.wait_for(waiting)
        while waiting or not self._host.linked():
            self._host.publish_initial()
            sample = self._acks.try_recv()
            if sample is None:
                sleep(0.005)
            elif (accepted := self._accept(sample, waiting)) is not None and accepted[1].step == -1:
                waiting.remove(accepted[0].name)
        self._watchdog.wait_for(())

    def _loop(self, progress: Callable[[Progress], None] | None) -> None:
        self._phase = "running"
        self._started_ns = monotonic_ns()
        shown = told = 0.0
        self._clock.start()
        while not self._clock.done and not self.state.ending:
            if not self._may_go_on():
                continue
            grant = self._next_grant()
            if grant is None:
                break
            self._step(grant)
            now = monotonic()
            if progress is not None and now - shown > _PROGRESS_S:
                shown = now
                progress(self._progress())
            if now - told > _STATUS_S:
                told = now
                self._tell_status()
        self._wall_ns = monotonic_ns() - self._started_ns
        if progress is not None:
            progress(self._progress())

    def _may_go_on(self) -> bool:
        if not self.state.paused:
            return True
        self._phase = "paused"
        self._tell_status()
        while not self.state.wait(0.2):
            self._raise_failures()
        self._phase = "running"
        self._clock.start()
        return not self.state.ending

    def _next_grant(self) -> Permission | None:
        """Return the next grant, with all that enters the simulation at this communication point."""
        if self._grants is not None:
            recorded = next(self._grants, None)
            if recorded is None:
                return None
            return Permission(self._run_id, recorded.epoch, recorded.step, recorded.start_ns, recorded.horizon_ns, recorded.inlets)
        time_ns = self._clock.time_ns
        self._scripted.read(time_ns, self._clock.step, lambda name, port, payload: self._inlets.offer(name, port, payload, monotonic_ns()))
        count = self._clock.horizon(self.state.budget)
        horizon_ns = time_ns + count * self.plan.step_ns
        return Permission(self._run_id, 0, self._clock.step, time_ns, horizon_ns, self._inlets.sample(monotonic_ns()))

    def _step(self, grant: Permission) -> None:
        """Publish a grant, take part in it, and wait until everybody else has."""
        count = (grant.horizon_ns - grant.start_ns) // self.plan.step_ns
        if self._remote or self._record is not None:
            payload = pack_permission(grant)
            self._observers.grant(grant, payload)
            if self._remote:
                self._grant_publisher.put(payload)
        waiting = [name for name in self.plan.order if -grant.step % self.plan.members[name].period < count]
        self._watchdog.wait_for(waiting)
        waiting = [name for name in waiting if self.plan.members[name].host != "hub"]
        self._host.run(grant, self._take)
        while waiting:
            accepted = self._accept(self._acks.recv(), waiting, grant)
            if accepted is not None:
                waiting.remove(accepted[0].name)
                self._take(*accepted)
        self._watchdog.wait_for(())
        for message in self._observers.books(grant.horizon_ns):
            self._energy_publishers[message.bond].put(encode(message))  # pyright: ignore[reportAttributeAccessIssue]
        self._clock.advance(count)
        self.state.spend(count)

    def _accept(self, sample: zenoh.Sample, waiting: Sequence[str], grant: Permission | None = None) -> tuple[Member, Report, bytes] | None:
        """Return a valid ack of this grant; raise what it reports; drop and count anything else."""
        try:
            member = self._by_ack.get(str(sample.key_expr))
            if member is None:
                raise MessageError("belongs to no participant of this run")
            payload = sample.payload.to_bytes()
            steps = 0 if grant is None else _steps_in(grant, member, self.plan.step_ns)
            report = unpack_report(payload, steps, steps * len(member.bonds))
            if report.run != self._run_id:
                raise MessageError(f"belongs to run {report.run:x}, this is run {self._run_id:x}")
            if report.error:
                raise ParticipantError(member.name, report.step if report.step >= 0 else self._clock.step, report.error)
            if member.name not in waiting or report.step != (-1 if grant is None else grant.step):
                raise MessageError(f"acknowledges step {report.step}, which nobody waits for")
        except MessageError as error:
            self._drops.count(sample, error)
            return None
        return member, report, payload

    def _take(self, member: Member, report: Report, payload: bytes | None = None) -> None:
        self._digests[member.name].update(struct.pack(f"<{len(report.state_hash)}Q", *report.state_hash))
        last = self._done[member.name] = report.step + (-report.step) % member.period + (len(report.state_hash) - 1) * member.period
        self._observers.report(member, report, (last + member.period) * self.plan.step_ns, payload)
        if self._on_report is not None:
            self._on_report(member, report)

    def _close(self) -> None:
        """End processes and close everything; the hosts end when the hub's token is gone."""
        self._tell_status()
        self._watchdog.end()
        self._token.undeclare()
        for loop in self._loops:
            loop.close()
        self._scripted.close()
        self._host.close()
        self._fleet.end()
        self._control.close()
        self._status_queryable.undeclare()
        for tap in self._taps:
            tap.undeclare()

    # --- what others ask and report --------------------------------------------------------------------------------

    def _fail(self, participant: str, cause: str) -> None:
        """Report a failure from any thread: as an ack of the participant, so that whoever waits for it hears of it."""
        log.error("participant '%s': %s", participant, cause)
        if participant in self._own_acks:
            self._own_acks[participant].put(pack_report(Report(self._run_id, 0, self._clock.step, (), (), (), cause)))
        else:
            name = self.plan.order[0]
            self._own_acks[name].put(pack_report(Report(self._run_id, 0, self._clock.step, (), (), (), f"device '{participant}': {cause}")))
        if self.plan.members[participant].host == "hub" and participant in self._watchdog.waiting:
            self._hung = (participant, self._clock.step, cause)
            threading.main_thread().is_alive() and __import__("_thread").interrupt_main()

    def _device_sample(self, sample: zenoh.Sample) -> None:
        _, _, _, device, _, port = str(sample.key_expr).split("/", 5)
        try:
            self._inlets.offer(device, port, sample.payload.to_bytes(), monotonic_ns())
        except MessageError as error:
            self._drops.count(sample, error)

    def _handlers(self) -> dict[str, tuple[type[Any], Callable[[Any], Any]]]:
        def then(action: Callable[[], None]) -> Callable[[Any], Empty]:
            def handler(_request: Empty) -> Empty:
                action()
                return Empty()

            return handler

        return {
            "join": (JoinRequest, self._join),
            "pause": (Empty, then(self.state.pause)),
            "resume": (Empty, then(self.state.resume)),
            "shutdown": (Empty, then(self.state.shutdown)),
            "step": (StepRequest, self._request_steps),
            "set": (SetRequest, self._request_set),
        }

    def _request_steps(self, request: StepRequest) -> Empty:
        self.state.step(request.steps)
        return Empty()

    def _request_set(self, request: SetRequest) -> Empty:
        port = self._inlets.settable(request.participant, request.port)
        codec = PortCodec(port)
        value = request.value
        if codec.vector is not None:
            import numpy as np

            message = codec.vector.to_message(codec.vector.checked(np.atleast_1d(np.asarray(value, np.float64))), self._clock.time_ns)
        else:
            message = message_type(port.type).model_validate(value)
        self._inlets.offer(request.participant, request.port, encode(message), monotonic_ns())
        return Empty()

    def _join(self, request: JoinRequest) -> JoinReply | Empty:
        names = [name for name, member in self.plan.members.items() if member.host == request.host]
        if not names or request.host == "hub":
            raise MessageError(f"session '{self.scenario.name}' has no host '{request.host}'; it has {', '.join(self.plan.hosts()[1:]) or 'none'}")
        known = self._joined.get(request.host)
        if known is not None and known.pid != request.pid:
            raise MessageError(f"host '{request.host}' is here already, as process {known.pid}")
        with self._join_changed:
            self._joined[request.host] = request
            self._join_changed.notify_all()
        if request.ready or request.failed:
            return Empty()
        params = {name: self.scenario.participants[name].params for name in names}
        return JoinReply(run=self._run_id, plan=self.plan, params=params, directory=str(self._directory))

    def _answer_status(self, query: zenoh.Query) -> None:
        with query:
            query.reply(self._keys.status, encode(self.status()), encoding=zenoh.Encoding.APPLICATION_CDR)

    def _tell_status(self) -> None:
        status = self.status()
        self._observers.status(status)
        self._status_publisher.put(encode(status))

    def status(self) -> SessionStatus:
        """Return what the session is doing now."""
        members = [
            ParticipantStatus(name=m.name, role=m.role, host=m.host, pid=self._pid(m.host), step=self._done.get(m.name, self._clock.step))
            for m in self.plan.members.values()
        ]
        return SessionStatus(
            session=self.scenario.name,
            run=self._run_id,
            state=self._phase,
            step=self._clock.step,
            sim_time_ns=self._clock.time_ns,
            real_time_factor=self._progress().real_time_factor,
            late_steps=self._clock.late_steps,
            dropped_messages=self._dropped,
            detail=self._failure,
            participants=members,
        )

    def _pid(self, host: str) -> int:
        import os

        if host == "hub":
            return os.getpid()
        return self._joined[host].pid if host in self._joined else self._fleet.pid(host)

    @property
    def _dropped(self) -> int:
        return self._drops.total + self._observers.drops.total

    def _progress(self) -> Progress:
        sim_s = self._clock.time_ns / 1e9
        wall_ns = self._wall_ns or (monotonic_ns() - self._started_ns if hasattr(self, "_started_ns") else 0)
        factor = sim_s / (wall_ns / 1e9) if wall_ns else 0.0
        return Progress(self._clock.step, self._steps, sim_s, factor, self._clock.late_steps, self._observers.measures.live())

    def _summary(self, recorded: RecorderSummary | None) -> Summary:
        digest = hashlib.blake2b(digest_size=16)
        for name, part in sorted(self._digests.items()):
            digest.update(name.encode() + part.digest())
        progress = self._progress()
        return Summary(
            session=self.scenario.name,
            state=self._phase,
            steps=self._clock.step,
            sim_time_s=progress.sim_time_s,
            wall_time_s=self._wall_ns / 1e9,
            real_time_factor=progress.real_time_factor,
            late_steps=self._clock.late_steps,
            dropped_messages=self._dropped,
            state_hash=digest.hexdigest(),
            recording=None if recorded is None else str(recorded.path),
            recording_complete=None if recorded is None else recorded.complete,
            energy_residual_j=self._observers.energy.residual_j,
            measures=self._observers.measures.results(),
        )


def _steps_in(grant: Permission, member: Member, step_ns: int) -> int:
    """Return how many steps a participant takes in a grant."""
    period = member.period
    return (grant.horizon_ns // step_ns - 1) // period - (grant.step - 1) // period
