"""All objects of a running session."""

from __future__ import annotations

import logging
import secrets
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import zenoh
from zenoh.handlers import Callback

from hub.devices.session_devices import SessionDevices
from hub.hosting.host import Host
from hub.hosting.host_processes import HostProcesses
from hub.hosting.interrupt import Interrupt
from hub.hosting.watchdog import Watchdog
from hub.observation.contact_watch import ContactWatch
from hub.observation.measures import Measures
from hub.observation.monitor import Monitor
from hub.participant import Device, Stepped
from hub.planning.contacts import MissingContact
from hub.planning.plan import Plan
from hub.planning.session_parameters import SessionParameters, Successors
from hub.recording.recorder import Recorder
from hub.security.gate import Gate
from hub.session.ack_receiver import AckReceiver
from hub.session.bookkeeping import Bookkeeping
from hub.session.clock import Clock
from hub.session.control_server import ControlServer
from hub.session.first_failure import FirstFailure
from hub.session.joined_hosts import JoinedHosts
from hub.session.observer_reports import ObserverReports
from hub.session.past import Past
from hub.session.remote_reports import RemoteReports
from hub.session.run_profile import RunProfile
from hub.session.run_state import RunState
from hub.session.status_reporter import StatusReporter
from hub.transport.control_messages import DescribeReply
from hub.transport.host_link import HubLink, has_link
from hub.transport.local_values import Inboxes, LocalValues
from hub.transport.refusals import Refusals
from hub.transport.router_client import RouterClient
from hub.transport.run_connection import RunConnection
from hub.transport.session_secret import secret_of
from hub.transport.wire import Wire
from hub.transport.zenoh_session import open_session
from schemas.files import Files
from schemas.keys import Keys
from schemas.scenario import Scenario

__all__ = ["Run", "SessionSpec"]

log = logging.getLogger(__name__)

_KEY_BYTES = 16


@dataclass(frozen=True)
class SessionSpec:
    """Specification of a run, and the endpoint of the hub."""

    scenario: Scenario
    plan: Plan
    participants: Mapping[str, Stepped | Device]
    """Participants and devices in this process, by name."""
    directory: Path
    """Where relative paths of the scenario start."""
    endpoint: str
    """Where the hub listens on loopback."""
    programs_endpoint: str
    """Endpoint for programs outside Trocar; empty if no device has keys for such programs."""
    gate: Gate | None
    """Gate for remote machines; None without remote machines."""
    past: Past | None = None
    """The recorded part of this run."""
    successors: Successors = field(default_factory=dict[str, Sequence[tuple[int, Stepped]]])
    """Successors in this process of `participants`, each with the first step."""
    profiled: bool = False
    """Where the time goes is measured."""
    recording: str = ""
    """The directory of the recording; empty: there is none."""
    missing_contacts: Sequence[MissingContact] = ()
    """Tools that pass through tissue within their reach."""

    @property
    def live_from(self) -> int | None:
        """The first step with devices in the lead; None: devices never lead."""
        return 0 if self.past is None else self.past.live_from

    @property
    def parameters(self) -> SessionParameters:
        """Kinds and parameters of all participants; those of a recording have passed its trust check."""
        if self.past is not None:
            return self.past.parameters
        return SessionParameters.of_scenario(self.scenario, Files(self.directory))

    @property
    def stepped(self) -> dict[str, Stepped]:
        """The engines and controllers of this process."""
        return {name: p for name, p in self.participants.items() if isinstance(p, Stepped)}

    @property
    def devices(self) -> dict[str, Device]:
        """The devices of this process needed by the run."""
        if self.live_from is None:
            return {}
        return {name: p for name, p in self.participants.items() if isinstance(p, Device)}


class Run:
    """A run of a session, complete from the start.

    `stack` closes the run, also the parts built before an error: first the watchdog, then the hub's token
    (the hosts of remote processes end with the token), then all parts in this process. Queries are answered
    to the last.
    """

    def __init__(
        self,
        stack: ExitStack,
        spec: SessionSpec,
        session: zenoh.Session,
        state: RunState,
        interrupt: Interrupt,
        recorder: Recorder | None,
    ) -> None:
        scenario, plan, keys = spec.scenario, spec.plan, Keys(spec.scenario.name)
        self.spec, self.state = spec, state
        self.connection = RunConnection(
            session,
            keys,
            plan,
            secrets.randbits(63) | 1,
            Refusals(),
            live_from_ns=(spec.live_from or 0) * plan.step_ns,
        )
        self.recorded = recorder is not None
        answering = stack.enter_context(ExitStack())
        inboxes = Inboxes(plan)
        self.processes = HostProcesses(_links(plan), inboxes)
        stack.callback(self.processes.end)
        self.clock = _clock(scenario, plan, spec.live_from or 0)
        measures = Measures(scenario, plan)
        for missing in spec.missing_contacts:
            measures.watch(ContactWatch(missing))
        self.monitor = Monitor(plan, keys, self.connection.number, measures, recorder)
        ack_keys = {host: secrets.token_bytes(_KEY_BYTES) for host in plan.hosts()}
        self.acks = AckReceiver(self.connection, ack_keys, self.processes.links)
        self.profile = RunProfile(self.connection, self.clock, self.monitor) if spec.profiled else None
        self.wire = Wire(self.connection, LocalValues(plan, "hub", inboxes.ends("hub")))
        self.host = self._host()
        """The stepped participants of this process."""
        stack.callback(self.host.close)
        self.failure = FirstFailure(plan, self.clock, self.host, self.acks, interrupt)
        self.devices = self._devices()
        stack.callback(self.devices.close)
        # first: else Zenoh calls Python for each reader that leaves, while a closing gateway waits for Zenoh
        stack.callback(self.wire.close)
        self.observer_reports = ObserverReports(self.connection)
        answering.callback(self.observer_reports.undeclare)
        self.bookkeeping = Bookkeeping(
            scenario, self.connection, self.clock, self.monitor, self.devices, self.observer_reports
        )
        self.joined_hosts = self._joined_hosts(ack_keys)
        self.status = StatusReporter(self.connection, self.bookkeeping, self.joined_hosts, self.monitor)
        answering.callback(self.status.undeclare)
        if self.profile is not None:
            answering.callback(self.profile.undeclare)
        self._answer(answering)
        if spec.gate is not None:
            stack.callback(spec.gate.close)
        token = session.liveliness().declare_token(keys.alive("hub", "hub"))
        stack.callback(token.undeclare)
        self.watchdog = Watchdog(
            plan, self.processes, scenario.answer_limit, lambda: self.host.awaited, self.fail
        )
        stack.callback(self.watchdog.end)

    def fail(self, participant: str, cause: str) -> None:
        """Report the failure of `participant` and end the run; from any thread.

        An observer's failure after the start is only reported: the run never waits for an observer.
        """
        if self.spec.plan.participants[participant].observer and self.bookkeeping.phase != "starting":
            self.observer_reports.lose(participant, cause)
        else:
            self.failure.report(participant, cause)

    def end(self, participant: str, reason: str) -> None:
        """End the session in good order when the present grant is done; from any thread.

        Status and summary name the first participant asking for the end.
        """
        if not self.bookkeeping.detail:
            self.bookkeeping.detail = f"participant '{participant}' has ended the session: {reason}"
            log.info("%s", self.bookkeeping.detail)
        self.state.shutdown()

    def _host(self) -> Host:
        """Return the host of this process, connected to the others."""
        spec, wire = self.spec, self.wire
        if self.profile is not None:
            self.profile.prepare(spec.stepped, wire)
        return Host(
            "hub", spec.plan, spec.stepped, wire=wire, listeners=self.monitor, successors=spec.successors
        )

    def _devices(self) -> SessionDevices:
        """Return the devices of the session; devices of this process are not yet open."""
        devices = self.spec.devices
        for device in devices.values():
            if isinstance(device, RouterClient):
                device.learn_hub(self._connect if device.demands_secret else self._connect_as_program)
        return SessionDevices(
            self.connection, devices, self.host.device_inputs, self.monitor, self.failure.report
        )

    def _connect(self) -> zenoh.Session:
        """Open a further Zenoh session with this hub, for a device of this process."""
        endpoint = self.spec.endpoint
        return open_session("client", connect=[endpoint], security=secret_of(endpoint))

    def _connect_as_program(self) -> zenoh.Session:
        """Open a Zenoh session with the router of programs."""
        return open_session("client", connect=[self.spec.programs_endpoint])

    def _joined_hosts(self, ack_keys: Mapping[str, bytes]) -> JoinedHosts:
        spec, run = self.spec, self.connection
        return JoinedHosts(
            spec.scenario.name,
            spec.plan,
            spec.parameters,
            run.number,
            list(self.monitor.remote_outputs.values()),
            self.fail,
            self.end,
            ack_keys=ack_keys,
            programs_endpoint=spec.programs_endpoint,
            profile=spec.profiled,
            live_from_ns=run.live_from_ns,
        )

    def _answer(self, answering: ExitStack) -> None:
        """Receive reports and values of remote processes, and answer control requests."""
        reports = RemoteReports(
            self.connection,
            self.devices,
            self.joined_hosts,
            self.bookkeeping,
            self.failure,
            self.observer_reports,
        )
        answering.callback(reports.undeclare)
        control = ControlServer(
            self.connection,
            self.state,
            self.devices.inlets,
            self.devices.network_links,
            self.joined_hosts,
            DescribeReply(
                session=self.spec.scenario.name,
                run=self.connection.number,
                scenario=self.spec.scenario,
                plan=self.spec.plan,
                recording=self.spec.recording,
            ),
        )
        answering.callback(control.undeclare)
        for key in self.monitor.remote_outputs:
            watch = self.connection.session.declare_subscriber(
                key, Callback(self.monitor.sample, indirect=False)
            )
            answering.callback(watch.undeclare)


def _clock(scenario: Scenario, plan: Plan, live_from: int) -> Clock:
    steps = None if scenario.duration is None else max(1, round(scenario.duration / scenario.step))
    realtime = scenario.pace == "realtime"
    return Clock(plan, window=scenario.window, realtime=realtime, steps=steps, live_from=live_from)


def _links(plan: Plan) -> dict[str, HubLink]:
    """Return a link to each host with stepped participants, where a link is possible."""
    names = dict[str, list[str]]()
    for name in plan.order:
        host = plan.participants[name].host
        if has_link(host):
            names.setdefault(host, []).append(name)
    return {host: HubLink(its) for host, its in names.items()}
