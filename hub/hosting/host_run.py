"""A run of a session in a host process: the participants of the host, stepped as the hub grants."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from time import sleep
from typing import NoReturn

import zenoh

from hub.devices.clock_sync import ClockSync
from hub.devices.device_thread import DeviceThread
from hub.devices.uplink import DeviceUplink
from hub.hosting.host import Host
from hub.hosting.host_profile import HostProfile
from hub.hosting.hub_channel import HubChannel, LinkChannel, ZenohChannel
from hub.hosting.low_priority import lower_priority
from hub.hosting.observing import Observing
from hub.participant import Device, Stepped
from hub.planning.plan import PlannedParticipant
from hub.planning.session_parameters import SessionParameters
from hub.transport.control_client import ask, ask_as_child
from hub.transport.control_messages import Empty, JoinReply, JoinRequest
from hub.transport.host_link import HostLink
from hub.transport.local_values import LocalValues
from hub.transport.router_client import RouterClient
from hub.transport.run_connection import RunConnection
from hub.transport.wire import Wire
from hub.transport.zenoh_session import open_session
from schemas.errors import MessageError, ParticipantError
from schemas.files import Files
from schemas.lockstep import Ack, Grant, unpack_grant

__all__ = ["HostRun"]

_PRIME_S = 0.01
_IDLE_S = 0.2


class HostRun:
    """The participants of this process in the run described by the hub's `reply`.

    `connect` opens another Zenoh session with the hub; relative paths of the scenario start at `directory`.
    A host started by the hub has a `link` to the hub.
    """

    def __init__(
        self,
        session: zenoh.Session,
        request: JoinRequest,
        reply: JoinReply,
        directory: Path,
        connect: Callable[[], zenoh.Session],
        link: HostLink | None = None,
    ) -> None:
        self._request, self._directory = request, directory
        self._next_step = 0
        self._ended: set[str] = set()
        plan, host = reply.plan, request.host
        mine = {name: planned for name, planned in plan.participants.items() if planned.host == host}
        parameters = SessionParameters(
            {name: planned.kind for name, planned in mine.items()},
            reply.params,
            tuple(reply.renewals),
            Files(directory),
        )
        ready = {name: parameters.make(name) for name in mine}
        participants = {name: first for name, (first, _) in ready.items()}
        self._run = RunConnection.of_host(session, reply, next(iter(mine.values())))
        keys = self._run.keys
        local = None if link is None else LocalValues(plan, host, link.inboxes)
        self._wire = wire = Wire(self._run, local, watched=reply.watched)
        stepped = {name: p for name, p in participants.items() if isinstance(p, Stepped)}
        self._profile = HostProfile(self._run, host) if reply.profile else None
        if self._profile is not None:
            self._profile.process.prepare(stepped, wire)
        self._host = Host(
            host,
            plan,
            stepped,
            wire=wire,
            place=None if link is None else link.place,
            successors={name: later for name, (_, later) in ready.items()},
        )
        self._hub = self._channel(bytes.fromhex(reply.ack_key), link)
        self._stack = ExitStack()
        self._clock: ClockSync | None = None
        if self._profile is not None:
            self._stack.callback(self._profile.undeclare)
            self._profile.attach(self._host, self._acknowledge)
        devices = {name: device for name, device in participants.items() if isinstance(device, Device)}
        self._threads = self._attach_devices(reply, devices, connect)
        self._observing: Observing | None = None
        if any(planned.observer for planned in mine.values()):
            self._observing = Observing(self._host, self._run)
            self._stack.callback(self._observing.close)
        self._tokens = [
            session.liveliness().declare_token(keys.alive(planned.key_role, name))
            for name, planned in mine.items()
        ]

    def _channel(self, ack_key: bytes, link: HostLink | None) -> HubChannel | None:
        """Return the channel of grants and acks; None for devices alone."""
        names = [planned.name for planned in self._host.participants if planned.in_step]
        if not names:
            return None
        if link is not None:
            return LinkChannel(link, names, self._check)
        return ZenohChannel(self._run, names, ack_key, self._check)

    def _attach_devices(
        self, reply: JoinReply, devices: Mapping[str, Device], connect: Callable[[], zenoh.Session]
    ) -> list[DeviceThread]:
        """Return a thread for each device, not started, with an uplink closed by the stack."""
        if not devices:
            return []
        threads: list[DeviceThread] = []
        self._clock = clock = ClockSync(self._run.session, self._run.keys)
        for name, device in devices.items():
            if isinstance(device, RouterClient):
                device.learn_hub(connect if device.demands_secret else _to_programs(reply) or connect)
            planned = reply.plan.participants[name]
            thread = DeviceThread(name, device, planned.read_ns, failed=self._report_failure)
            uplink = DeviceUplink(planned, self._run, thread, clock.offset)
            self._stack.callback(uplink.close)
            thread.attach(uplink)
            threads.append(thread)
        return threads

    def serve(self) -> None:
        """Configure, report ready, and step as the hub grants, or look on, until interrupted."""
        if self._clock is not None:
            self._stack.enter_context(self._clock)
        try:
            bonds = self._host.configure(self._directory)
            for thread in self._threads:
                thread.start(self._directory)
        except ParticipantError as error:
            self._report_failure(error.participant, error.cause)
            raise
        ready = self._request.model_copy(update={"ready": True, "bonds": bonds})
        self._send_to_hub(ready)
        if self._observing is not None:
            self._observe(self._observing, ready)
        if self._hub is None:  # devices alone, which live in threads of their own
            while True:
                sleep(_IDLE_S)
        self._step_as_granted(self._hub)

    def _step_as_granted(self, hub: HubChannel) -> None:
        done = partial(self._acknowledge, hub)
        grant = self._first_grant(hub)
        while True:
            try:
                self._host.run(grant, done)
            except ParticipantError as error:
                hub.acknowledge(
                    error.participant, Ack(self._run.number, 0, error.step, (), (), (), error.cause)
                )
                hub.flush()
                raise
            hub.flush()
            grant = self._next_grant(hub)

    def _observe(self, observing: Observing, ready: JoinRequest) -> NoReturn:
        """Look until the process is interrupted, and report when the state at time 0 was seen."""

        def began() -> None:
            lower_priority()  # not before: until here the session waits for this process
            self._send_to_hub(ready.model_copy(update={"watching": True}))

        try:
            observing.serve(began)
        except ParticipantError as error:
            self._report_failure(error.participant, error.cause)
            raise

    def _first_grant(self, hub: HubChannel) -> Grant:
        """Repeat the values at time 0 until every connection has carried a value and a grant has arrived."""
        ready = False
        while True:
            self._host.publish_initial()
            if not ready and self._host.has_initial_values():
                ready = True
                for planned in self._host.participants:
                    hub.acknowledge(planned.name, Ack(self._run.number, 0, -1, (), (), ()))
                hub.flush()
            if ready and (grant := hub.grant(wait=False)) is not None:
                return grant
            sleep(_PRIME_S)

    def _next_grant(self, hub: HubChannel) -> Grant:
        while True:
            grant = hub.grant(wait=True)
            if grant is not None:
                return grant
            self._wire.take_arrived()  # a host still stepping may wait for room

    def _check(self, payload: bytes) -> Grant:
        """Return the grant in `payload`; raises MessageError unless this is the next grant of the run."""
        grant = unpack_grant(payload)
        if grant.run != self._run.number:
            raise MessageError(f"belongs to run {grant.run:x}, this is run {self._run.number:x}")
        step_ns = self._run.plan.step_ns
        if (
            grant.step != self._next_step
            or grant.start_ns != grant.step * step_ns
            or grant.horizon_ns <= grant.start_ns
        ):
            raise MessageError(
                f"grants step {grant.step} at {grant.start_ns} to {grant.horizon_ns} ns, when step"
                f" {self._next_step} is next"
            )
        self._next_step = grant.horizon_ns // step_ns
        return grant

    def _acknowledge(self, hub: HubChannel, planned: PlannedParticipant, ack: Ack) -> None:
        reason = self._host.ended.get(planned.name)
        if reason and planned.name not in self._ended:
            self._ended.add(planned.name)
            # before the ack: the hub gives no grant after it
            self._send_to_hub(self._request.model_copy(update={"ended": f"{planned.name}: {reason}"}))
        hub.acknowledge(planned.name, ack)

    def _report_failure(self, name: str, cause: str) -> None:
        self._send_to_hub(self._request.model_copy(update={"failed": f"{name}: {cause}"}))

    def _send_to_hub(self, request: JoinRequest) -> None:
        send = ask_as_child if request.is_local else ask
        send(self._run.session, self._run.keys.join(request.host), request, Empty)

    def close(self) -> None:
        """Close devices, participants and publishers."""
        with self._stack:  # closed even if Ctrl-C interrupts a device
            for thread in self._threads:
                thread.close()
        self._host.close()
        for token in self._tokens:
            token.undeclare()


def _to_programs(reply: JoinReply) -> Callable[[], zenoh.Session] | None:
    """Return a function to open a Zenoh session with the router of programs; None on a remote machine."""
    if not reply.programs_endpoint:
        return None
    return partial(open_session, "client", connect=[reply.programs_endpoint])
