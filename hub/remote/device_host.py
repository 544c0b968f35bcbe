"""The host process of a device: joins a session, and joins again when the hub returns."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from time import sleep
from typing import Any

import zenoh
from zenoh.handlers import Callback

from hub.devices.clock_sync import ClockSync
from hub.devices.device_thread import DeviceThread
from hub.devices.uplink import DeviceUplink
from hub.participant import Device
from hub.planning.session_parameters import SessionParameters
from hub.transport.control_client import ask, join_session
from hub.transport.control_messages import Empty, JoinReply, JoinRequest
from hub.transport.router_client import RouterClient
from hub.transport.run_connection import RunConnection
from schemas.errors import ConnectError, MessageError, ParticipantError
from schemas.files import Files
from schemas.keys import Keys

__all__ = ["DeviceHost"]

log = logging.getLogger(__name__)

_RETRY_S = 0.5
_POLL_S = 0.2
"""A wait this short can be interrupted with Ctrl-C on every system."""


class DeviceHost:
    """Keeps a device open, and takes part in one run of a session after the other."""

    def __init__(
        self,
        name: str,
        connect: Callable[[], zenoh.Session],
        keys: Keys,
        request: JoinRequest,
        directory: Path | None,
    ) -> None:
        """Prepare a host.

        Args:
            name: Name of the device.
            connect: Opens a Zenoh session with the hub.
            keys: Keys of the session to join, or of `*` for any session of the hub.
            request: The request to join.
            directory: Where relative paths start; None: in the hub's directory.
        """
        self._name, self._connect, self._keys = name, connect, keys
        self._request, self._directory = request, directory
        self._loop: DeviceThread | None = None
        self._held: tuple[Any, ...] = ()
        self._failure: ParticipantError | None = None
        self.joined: Callable[[], None] = lambda: None
        """Is called each time the device takes part in a run."""
        self._over = threading.Event()
        """The run is over: the hub is gone, or the device has failed."""

    def serve(self, check: Callable[[], None]) -> None:
        """Take part in one run after the other, until an error; `check` raises a lost interrupt.

        Raises ConnectError or MessageError if the first run cannot be joined, and ParticipantError if the
        device fails.
        """
        joined, logged = False, ""
        try:
            while True:
                try:
                    with self._connect() as session:
                        reply = join_session(session, self._keys, self._request)
                        joined, logged = True, ""
                        self._take_part(session, reply, check)
                    log.warning(
                        "device '%s': lost the hub; the device receives nothing until the hub returns and it"
                        " joins again",
                        self._name,
                    )
                # Zenoh's own: a session whose network is gone cannot be closed in time
                except (ConnectError, MessageError, zenoh.ZError) as error:
                    if not joined:
                        raise
                    if str(error) != logged:
                        logged = str(error)
                        log.info("device '%s' waits for the hub: %s", self._name, logged)
                    check()
                    sleep(_RETRY_S)
        finally:
            if self._loop is not None:
                self._loop.close()

    def _take_part(self, session: zenoh.Session, reply: JoinReply, check: Callable[[], None]) -> None:
        """Take part in a run until the end."""
        keys, planned = Keys(reply.session), reply.plan.participants[self._name]
        self._over.clear()
        with ExitStack() as stack:
            gone = session.liveliness().declare_subscriber(
                keys.alive("hub", "hub"), Callback(self._on_hub, indirect=True), history=True
            )
            stack.callback(gone.undeclare)
            run = RunConnection.of_host(session, reply, planned)
            try:
                loop = self._device_loop(reply)
            except ParticipantError as error:
                self._ask(
                    session,
                    self._request.model_copy(update={"failed": f"{error.participant}: {error.cause}"}),
                )
                raise
            clock = stack.enter_context(ClockSync(session, keys))
            uplink = DeviceUplink(planned, run, loop, clock.offset)
            stack.callback(uplink.close)
            loop.attach(uplink)
            token = session.liveliness().declare_token(keys.alive("device", self._name))
            stack.callback(token.undeclare)
            self._ask(session, self._request.model_copy(update={"ready": True}))
            self.joined()
            log.info("device '%s' takes part in session '%s'", self._name, keys.session)
            while not self._over.wait(_POLL_S):
                check()
            if self._failure is not None:
                self._ask(
                    session,
                    self._request.model_copy(
                        update={"failed": f"{self._failure.participant}: {self._failure.cause}"}
                    ),
                )
                raise self._failure

    def _device_loop(self, reply: JoinReply) -> DeviceThread:
        """Return the thread of the device: the last run's, unless kind, parameters or period have changed."""
        planned, params = reply.plan.participants[self._name], reply.params[self._name]
        wanted = (planned.kind, params, planned.read_ns, reply.directory)
        if self._loop is None or self._held != wanted:
            if self._loop is not None:
                self._loop.close()
            directory = self._directory or Path(reply.directory)
            kinds, last = {self._name: planned.kind}, {self._name: params}
            device, _ = SessionParameters(kinds, last, (), Files(directory)).make(self._name)
            if not isinstance(device, Device):
                raise ParticipantError(self._name, -1, f"kind '{planned.kind}' is no device on this machine")
            if isinstance(device, RouterClient):
                device.learn_hub(self._connect)
            self._loop, self._held = (
                DeviceThread(self._name, device, planned.read_ns, failed=self._device_failed),
                wanted,
            )
            self._loop.start(directory)
        return self._loop

    def _ask(self, session: zenoh.Session, request: JoinRequest) -> None:
        ask(session, self._keys.join(self._request.host), request, Empty)

    def _on_hub(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.DELETE:
            self._over.set()

    def _device_failed(self, name: str, cause: str) -> None:
        self._failure = ParticipantError(name, -1, cause)
        self._over.set()
