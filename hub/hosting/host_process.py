"""A process that runs one host of a session: `python -P -m hub.hosting.host_process --connect ENDPOINT
--session NAME --host NAME`.

It joins a hub, makes and configures its participants, steps them as grants come, and ends when the hub is
gone.
"""

from __future__ import annotations

import argparse
import contextlib
import logging
import os
import sys
import threading
from collections.abc import Callable, Generator
from functools import partial
from importlib.metadata import version
from pathlib import Path
from time import sleep

import zenoh
from zenoh.handlers import Callback, FifoChannel

from hub.devices.clock_watch import ClockWatch
from hub.devices.loop import DeviceLoop
from hub.devices.uplink import DeviceUplink, Run
from hub.hosting.host import Host
from hub.hosting.interrupt import Interrupt
from hub.participant import Device, Stepped
from hub.planning.plan import PlannedParticipant
from hub.planning.registry import make
from hub.remote.device_host import DeviceHost
from hub.remote.hub_connection import reach
from hub.transport.control_client import ask, present
from hub.transport.control_messages import Empty, JoinReply, JoinRequest
from hub.transport.lane import may_spin
from hub.transport.refusals import Drops
from hub.transport.router_client import RouterClient
from hub.transport.wire import Wire
from schemas.codec import encode
from schemas.errors import MessageError, ParticipantError, TrocarError
from schemas.keys import Keys
from schemas.lockstep import Ack, Grant, pack_ack, unpack_grant
from schemas.ros import StringMessage

__all__ = ["main", "run_device", "run_host"]

log = logging.getLogger(__name__)

_PRIME_S = 0.01
_IDLE_S = 0.2
_PATIENCE_S = 2.0
"""How long a participant may go on computing after the hub is gone, before the process is ended under it."""


def run_host(
    endpoint: str,
    session_name: str,
    host: str,
    *,
    directory: Path | None = None,
    certificates: Path | None = None,
) -> None:
    """Join session `session_name` (`*`: whatever there is) over `endpoint` and run host `host` until the hub
    ends.

    A participant with `host: remote` is a host of its own, called `remote/<participant>`. Relative paths of
    the scenario start at `directory`, by default where the hub has them. `certificates`: as
    `hub.remote.hub_connection.reach` has it.

    Raises ConnectError if there is no such hub, and ParticipantError if a participant of this host fails.
    """
    request = JoinRequest(host=host, pid=os.getpid())
    with reach(endpoint, host.removeprefix("remote/"), certificates, mode="peer") as session:
        reply = present(session, Keys(session_name), request)
        keys = Keys(reply.session)
        with _ending_with_hub(session, keys):
            connect = partial(reach, endpoint, host.removeprefix("remote/"), certificates)
            joined = _JoinedHost(session, keys, request, reply, directory or Path(reply.directory), connect)
            try:
                joined.serve()
            finally:
                joined.close()


def run_device(
    endpoint: str,
    session_name: str,
    name: str,
    *,
    directory: Path | None = None,
    certificates: Path | None = None,
) -> None:
    """Join session `session_name` (`*`: whatever there is) over `endpoint` with the device `name`, and
    whatever comes after it, until Ctrl-C or SIGTERM.

    `directory` and `certificates` are as for `run_host`. Raises ConnectError if there is no such hub to begin
    with, MessageError if it has no place for the device, and ParticipantError if the device fails.
    """
    request = JoinRequest(host=f"remote/{name}", pid=os.getpid())
    host = DeviceHost(
        name, lambda: reach(endpoint, name, certificates), Keys(session_name), request, directory
    )
    with Interrupt(), contextlib.suppress(KeyboardInterrupt):
        host.serve()


class _JoinedHost:
    """The participants of this process and their connection to the hub."""

    def __init__(
        self,
        session: zenoh.Session,
        keys: Keys,
        request: JoinRequest,
        reply: JoinReply,
        directory: Path,
        connect: Callable[[], zenoh.Session],
    ) -> None:
        self._session, self._keys, self._request, self._run, self._directory = (
            session,
            keys,
            request,
            reply.run,
            directory,
        )
        plan, host = reply.plan, request.host
        self._step_ns = plan.step_ns
        mine = {name: planned for name, planned in plan.participants.items() if planned.host == host}
        made = {
            name: make(planned.kind, name, reply.params[name], directory) for name, planned in mine.items()
        }
        first = next(iter(mine.values()))
        refused = session.declare_publisher(
            keys.refused(first.key_role, first.name), encoding=zenoh.Encoding.APPLICATION_CDR
        )
        self._drops = Drops(tell=lambda key: refused.put(encode(StringMessage(data=key))))
        self._wire = Wire(
            session,
            keys,
            reply.run,
            self._drops,
            host,
            spin=may_spin(len(plan.hosts())),
            watched=reply.watched,
        )
        self._host = Host(
            host, plan, {name: p for name, p in made.items() if isinstance(p, Stepped)}, wire=self._wire
        )
        self._acks = {
            planned.name: session.declare_publisher(
                keys.ack(planned.name),
                encoding=zenoh.Encoding.APPLICATION_CDR,
                congestion_control=zenoh.CongestionControl.BLOCK,
                priority=zenoh.Priority.REAL_TIME,
                express=True,
            )
            for planned in self._host.participants
        }
        if self._acks:
            self._grants = session.declare_subscriber(keys.grant, FifoChannel(256))
        self._next_step = 0
        devices = {name: device for name, device in made.items() if isinstance(device, Device)}
        for device in devices.values():
            if isinstance(device, RouterClient):
                device.learn_hub(connect)
        self._loops = {
            name: DeviceLoop(name, device, plan.participants[name].read_ns, failed=self._device_failed)
            for name, device in devices.items()
        }
        self._stack = contextlib.ExitStack()
        if devices:
            clock, run = (
                self._stack.enter_context(ClockWatch(session, keys)),
                Run(plan, keys, reply.run, reply.admission),
            )
            for name, loop in self._loops.items():
                uplink = DeviceUplink(plan.participants[name], run, session, loop, self._drops, clock.offset)
                self._stack.callback(uplink.close)
                loop.attach(uplink)
        self._tokens = [
            session.liveliness().declare_token(keys.alive(planned.key_role, name))
            for name, planned in mine.items()
        ]

    def serve(self) -> None:
        """Configure, report ready, prime the links, and step until the hub says that the run is over."""
        try:
            bonds = self._host.configure(self._directory)
            for loop in self._loops.values():
                loop.start(self._directory)
        except ParticipantError as error:
            ask(
                self._session,
                self._keys.join(self._request.host),
                self._request.model_copy(update={"failed": f"{error.participant}: {error.cause}"}),
                Empty,
            )
            raise
        ask(
            self._session,
            self._keys.join(self._request.host),
            self._request.model_copy(update={"ready": True, "bonds": bonds}),
            Empty,
        )
        while not self._acks:  # devices alone, which live in threads of their own
            sleep(_IDLE_S)
        grant = self._first_grant()
        while True:
            try:
                self._host.run(grant, self._done)
            except ParticipantError as error:
                self._acks[error.participant].put(
                    pack_ack(Ack(self._run, 0, error.step, (), (), (), error.cause))
                )
                raise
            grant = self._next_grant()

    def _first_grant(self) -> Grant:
        """Repeat the values at time 0 until all links have carried theirs and the first grant is here."""
        told = False
        while True:
            self._host.publish_initial()
            if not told and self._host.linked():
                told = True
                for planned in self._host.participants:
                    self._done(planned, Ack(self._run, 0, -1, (), (), ()))
            if told and (sample := self._grants.try_recv()) is not None:
                grant = self._accept(sample)
                if grant is not None:
                    return grant
            sleep(_PRIME_S)

    def _next_grant(self) -> Grant:
        while True:
            grant = self._accept(self._grants.recv())
            if grant is not None:
                return grant

    def _accept(self, sample: zenoh.Sample) -> Grant | None:
        try:
            grant = unpack_grant(sample.payload.to_bytes())
            if grant.run != self._run:
                raise MessageError(f"belongs to run {grant.run:x}, this is run {self._run:x}")
            if (
                grant.step != self._next_step
                or grant.start_ns != grant.step * self._step_ns
                or grant.horizon_ns <= grant.start_ns
            ):
                raise MessageError(
                    f"grants step {grant.step} at {grant.start_ns} to {grant.horizon_ns} ns, when step"
                    f" {self._next_step} is next"
                )
        except MessageError as error:
            self._drops.count(sample, error)
            return None
        self._next_step = grant.horizon_ns // self._step_ns
        return grant

    def _done(self, planned: PlannedParticipant, ack: Ack) -> None:
        self._acks[planned.name].put(pack_ack(ack))

    def _device_failed(self, name: str, cause: str) -> None:
        ask(
            self._session,
            self._keys.join(self._request.host),
            self._request.model_copy(update={"failed": f"{name}: {cause}"}),
            Empty,
        )

    def close(self) -> None:
        """Close devices, participants and publishers."""
        for loop in self._loops.values():
            loop.close()
        self._stack.close()
        self._host.close()
        for token in self._tokens:
            token.undeclare()


@contextlib.contextmanager
def _ending_with_hub(session: zenoh.Session, keys: Keys) -> Generator[None]:
    """Interrupt the main thread when the hub's liveliness token is gone, and end the process if that does not
    help.
    """
    over, interrupt = threading.Event(), Interrupt()

    def gone(sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.DELETE and not over.is_set():
            log.debug("the hub is gone")
            interrupt()
            threading.Thread(target=force, daemon=True).start()

    def force() -> None:
        if not over.wait(_PATIENCE_S):
            os._exit(1)

    watch = session.liveliness().declare_subscriber(
        keys.alive("hub", "hub"), Callback(gone, indirect=True), history=True
    )
    try:
        with interrupt, contextlib.suppress(KeyboardInterrupt):
            yield
            interrupt.disarm()
    finally:
        over.set()
        watch.undeclare()


def main() -> None:
    """Run a host; exit code 1 if one of its participants failed."""
    parser = argparse.ArgumentParser(
        prog="python -P -m hub.hosting.host_process",
        description=f"Host process of Trocar {version('trocar')}.",
    )
    for option in ("--connect", "--session", "--host"):
        parser.add_argument(option, required=True)
    arguments = parser.parse_args()
    logging.basicConfig(
        level=logging.INFO, format=f"%(levelname)s [{arguments.host}] %(message)s", stream=sys.stderr
    )
    try:
        run_host(arguments.connect, arguments.session, arguments.host)
    except TrocarError as error:
        log.error("%s", error)  # the cause is in the message; the traceback was logged where it happened
        sys.exit(1)


if __name__ == "__main__":
    main()
