"""Joins a session with this process: as a host, or with a device for session after session.

The process makes and configures the host's participants, and steps as the hub grants, until the hub is gone.
"""

from __future__ import annotations

import contextlib
import logging
import os
import threading
from collections.abc import Generator
from functools import partial
from pathlib import Path

import zenoh
from zenoh.handlers import Callback

from hub.hosting.host_run import HostRun
from hub.hosting.interrupt import Interrupt
from hub.remote.device_host import DeviceHost
from hub.remote.hub_connection import reach
from hub.transport.control_client import join_session
from hub.transport.control_messages import JoinRequest
from hub.transport.host_link import HostLink
from schemas.keys import Keys

__all__ = ["run_device", "run_host"]

log = logging.getLogger(__name__)

_PATIENCE_S = 2.0
"""Longest time for a participant to go on computing after the hub is gone, before the process is ended."""


def run_host(
    endpoint: str,
    session_name: str,
    host: str,
    *,
    directory: Path | None = None,
    certificates: Path | None = None,
    link: HostLink | None = None,
) -> None:
    """Join a session and run a host of the session until the hub ends.

    Args:
        endpoint: The endpoint of the hub.
        session_name: The session; `*` for whatever session the hub has.
        host: The host; a participant with `host: remote` is a separate host, `remote/<participant>`.
        directory: Base of relative paths of the scenario, by default the hub's base.
        certificates: As for `hub.remote.hub_connection.reach`.
        link: The link to the hub, for a process started with a link.

    Raises ConnectError if there is no such hub, and ParticipantError if a participant of this host fails.
    """
    request = JoinRequest(host=host, pid=os.getpid())
    connect = partial(reach, endpoint, host.removeprefix("remote/"), certificates)
    with connect(mode="peer") as session:
        reply = join_session(session, Keys(session_name), request)
        with _ending_with_hub(session, Keys(reply.session)):
            run = HostRun(session, request, reply, directory or Path(reply.directory), connect, link)
            try:
                run.serve()
            finally:
                run.close()


def run_device(
    endpoint: str,
    session_name: str,
    name: str,
    *,
    directory: Path | None = None,
    certificates: Path | None = None,
) -> None:
    """Join a session with the device `name`, and all later sessions, until Ctrl-C or SIGTERM.

    The arguments are as in `run_host`. Raises ConnectError if there is no such hub at first, MessageError if
    the hub's session does not have the device, and ParticipantError if the device fails.
    """
    request = JoinRequest(host=f"remote/{name}", pid=os.getpid())
    connect = partial(reach, endpoint, name, certificates)
    host = DeviceHost(name, connect, Keys(session_name), request, directory)
    with Interrupt() as interrupt, contextlib.suppress(KeyboardInterrupt):
        host.serve(interrupt.check)


@contextlib.contextmanager
def _ending_with_hub(session: zenoh.Session, keys: Keys) -> Generator[None]:
    """Interrupt the main thread when the hub's liveliness token is gone; end the process if that fails."""
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
