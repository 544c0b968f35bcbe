"""All that exists while a session runs."""

from __future__ import annotations

import logging
import secrets
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import zenoh
from zenoh.handlers import Callback

from hub.devices.run_info import RunInfo
from hub.devices.session_devices import SessionDevices
from hub.hosting.host import Host
from hub.hosting.host_processes import HostProcesses
from hub.hosting.interrupt import Interrupt
from hub.hosting.watchdog import Watchdog
from hub.observation.measures import Measures
from hub.observation.observers import Observers
from hub.participant import Device, Stepped
from hub.planning.plan import Plan
from hub.recording.recorder import Recorder
from hub.security.gate import Gate
from hub.session.ack_receiver import AckReceiver
from hub.session.bookkeeping import Bookkeeping
from hub.session.clock import Clock
from hub.session.control_server import ControlServer
from hub.session.first_failure import FirstFailure
from hub.session.joined_hosts import JoinedHosts
from hub.session.remote_reports import RemoteReports
from hub.session.run_state import RunState
from hub.session.status_reporter import StatusReporter
from hub.transport.lane import may_spin
from hub.transport.refusals import Refusals
from hub.transport.router_client import RouterClient
from hub.transport.wire import Wire
from hub.transport.zenoh_session import open_session
from schemas.keys import Keys
from schemas.scenario import Scenario

__all__ = ["Run", "SessionSpec"]

log = logging.getLogger(__name__)

_KEY_BYTES = 16


@dataclass(frozen=True)
class SessionSpec:
    """What is to be run, and where the hub listens."""

    scenario: Scenario
    plan: Plan
    participants: Mapping[str, Stepped | Device]
    """Those that live in this process, by name."""
    directory: Path
    """Where relative paths of the scenario start."""
    endpoint: str
    """Where the hub listens on loopback."""
    programs_endpoint: str
    """Where programs outside Trocar connect; empty if no device has keys for them."""
    gate: Gate | None
    """Lets other machines in."""
    resimulated: bool
    """Grants come from a recording: no device is needed."""

    @property
    def stepped(self) -> dict[str, Stepped]:
        """The engines and controllers of this process."""
        return {name: p for name, p in self.participants.items() if isinstance(p, Stepped)}

    @property
    def devices(self) -> dict[str, Device]:
        """The devices of this process that the run needs."""
        if self.resimulated:
            return {}
        return {name: p for name, p in self.participants.items() if isinstance(p, Device)}


class Run:
    """One run of a session, complete when it is made.

    `stack` closes it, also what was built before an error: first the watchdog, then the hub's token, with
    which the hosts of other processes end, then what lives in this process. Queries are answered to the last.
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
        self.spec, self.session, self.keys, self.state = spec, session, keys, state
        self.number = secrets.randbits(63) | 1
        """Tells the messages of this run from those of any other."""
        self.recorded = recorder is not None
        answering = stack.enter_context(ExitStack())
        self.processes = HostProcesses()
        stack.callback(self.processes.end)
        self.refusals = Refusals()
        self.clock = _clock(scenario, plan)
        self.observers = Observers(plan, keys, self.number, Measures(scenario, plan), recorder)
        ack_keys = {host: secrets.token_bytes(_KEY_BYTES) for host in plan.hosts()}
        self.acks = AckReceiver(session, keys, plan, self.number, self.refusals, ack_keys)
        self.host = self._host()
        """The stepped participants of this process."""
        stack.callback(self.host.close)
        self.failure = FirstFailure(plan, self.clock, self.host, self.acks, interrupt)
        self.devices = self._devices()
        stack.callback(self.devices.close)
        self.bookkeeping = Bookkeeping(
            scenario, plan, self.number, self.clock, self.refusals, self.observers, self.devices
        )
        watched = list(self.observers.away.values())
        self.joined_hosts = JoinedHosts(
            scenario,
            plan,
            spec.directory,
            self.number,
            watched,
            self.failure.report,
            self.end,
            ack_keys=ack_keys,
            programs_endpoint=spec.programs_endpoint,
        )
        self.status = StatusReporter(session, keys, self.bookkeeping, self.joined_hosts, self.observers)
        answering.callback(self.status.undeclare)
        self._answer(answering)
        if spec.gate is not None:
            stack.callback(spec.gate.close)
        token = session.liveliness().declare_token(keys.alive("hub", "hub"))
        stack.callback(token.undeclare)
        self.watchdog = Watchdog(
            plan, self.processes, scenario.answer_limit, lambda: self.host.awaited, self.failure.report
        )
        stack.callback(self.watchdog.end)

    def end(self, participant: str, reason: str) -> None:
        """End the session in good order when the present grant is done; from any thread.

        The first participant that asks for it is the one that status and summary name.
        """
        if not self.bookkeeping.detail:
            self.bookkeeping.detail = f"participant '{participant}' has ended the session: {reason}"
            log.info("%s", self.bookkeeping.detail)
        self.state.shutdown()

    def _host(self) -> Host:
        """Return the host of this process, connected to the others over Zenoh."""
        spin = may_spin(len(self.spec.plan.hosts()))
        wire = Wire(self.session, self.keys, self.number, self.refusals, "hub", spin=spin)
        listener = self.observers.value if self.observers.watches_values else None
        return Host("hub", self.spec.plan, self.spec.stepped, wire=wire, listener=listener)

    def _devices(self) -> SessionDevices:
        """Return the devices of the session, those of this process not yet open."""
        endpoint, devices = self.spec.programs_endpoint, self.spec.devices
        for device in devices.values():
            if isinstance(device, RouterClient):
                device.learn_hub(lambda: open_session("client", connect=[endpoint]))
        return SessionDevices(
            RunInfo(self.spec.plan, self.keys, self.number),
            self.session,
            devices,
            self.host.device_inputs,
            self.observers,
            self.refusals,
            self.failure.report,
        )

    def _answer(self, answering: ExitStack) -> None:
        """Receive what other processes report and publish, and answer control requests."""
        session, keys = self.session, self.keys
        reports = RemoteReports(
            session,
            keys,
            self.spec.plan,
            self.devices,
            self.joined_hosts,
            self.bookkeeping,
            self.failure,
            self.refusals,
        )
        answering.callback(reports.undeclare)
        control = ControlServer(
            session,
            keys,
            self.state,
            self.devices.inlets,
            self.devices.network_links,
            self.joined_hosts,
            self.refusals,
        )
        answering.callback(control.undeclare)
        for key in self.observers.away:
            watch = session.declare_subscriber(key, Callback(self.observers.sample, indirect=False))
            answering.callback(watch.undeclare)


def _clock(scenario: Scenario, plan: Plan) -> Clock:
    steps = None if scenario.duration is None else max(1, round(scenario.duration / scenario.step))
    return Clock(plan, window=scenario.window, realtime=scenario.pace == "realtime", steps=steps)
