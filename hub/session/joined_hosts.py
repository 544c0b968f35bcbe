"""The hosts joined to a session: hosts report readiness or failure, and may be lost."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Mapping, Sequence

from hub.planning.plan import Plan
from hub.planning.session_parameters import SessionParameters
from hub.transport.control_messages import Empty, JoinReply, JoinRequest
from hub.transport.zenoh_session import LEASE_MS
from schemas.errors import MessageError
from schemas.ports import BondSide

__all__ = ["JoinedHosts"]


class JoinedHosts:
    """The hosts of a session, without the hub's own.

    Args:
        session: The name of the session.
        plan: The wiring of the session.
        parameters: The kinds and parameters of all participants.
        run: The number of the run.
        watched: Outputs with every value needed by the hub.
        failed: Is called with participant and cause when a host reports a failure.
        ended: Is called with participant and reason when a host reports the end of the session by a
            participant.
        ack_keys: Keys of the signatures of acks, by host.
        programs_endpoint: Endpoint of this machine for programs outside Trocar.
        profile: The hosts of this machine keep a profile.
        live_from_ns: Simulated time until which the run repeats a recorded run.
    """

    def __init__(
        self,
        session: str,
        plan: Plan,
        parameters: SessionParameters,
        run: int,
        watched: Sequence[tuple[str, str]],
        failed: Callable[[str, str], None],
        ended: Callable[[str, str], None],
        *,
        ack_keys: Mapping[str, bytes],
        programs_endpoint: str = "",
        profile: bool = False,
        live_from_ns: int = 0,
    ) -> None:
        self._profile = profile
        self._live_from_ns = live_from_ns
        self._ack_keys = ack_keys
        self._programs_endpoint = programs_endpoint
        self._watched = list(watched)
        self._session = session
        self._plan = plan
        self._parameters = parameters
        self._run = run
        self._failed = failed
        self._ended = ended
        self._hosts: dict[str, JoinRequest] = {}
        self._admissions = 0
        self._changed = threading.Condition()

    def join(self, request: JoinRequest) -> JoinReply | Empty:
        """Answer a host's request: to join, ready, failed, or session ended.

        Raises MessageError to refuse the request.
        """
        names = [name for name, planned in self._plan.participants.items() if planned.host == request.host]
        if not names or request.host == "hub":
            hosts = (
                ", ".join(host for host in self._plan.hosts() if host != "hub") or "none but the hub's own"
            )
            raise MessageError(f"session '{self._session}' has no host '{request.host}'; it has {hosts}")
        participant, _, cause = (request.failed or request.ended).partition(": ")
        if participant and participant not in names:
            raise MessageError(
                f"host '{request.host}' has no participant '{participant}' that could fail or end the session"
            )
        with self._changed:
            known = self._hosts.get(request.host)
            if known is not None and known.pid != request.pid:
                lease_s = LEASE_MS / 1e3
                raise MessageError(
                    f"host '{request.host}' has joined already, as process {known.pid}: end that one, or wait"
                    f" {lease_s:g} s if it is cut off"
                )
            self._hosts[request.host] = request
            self._admissions += 1
            self._changed.notify_all()
        if request.failed:
            self._failed(participant, cause)
        elif request.ended:
            self._ended(participant, cause)
        if request.ready or request.failed or request.ended:
            return Empty()
        params, renewals = self._parameters.of(names)
        return JoinReply(
            session=self._session,
            run=self._run,
            admission=self._admissions,
            plan=self._plan if request.is_local else self._plan.seen_from(request.host),
            params=params,
            directory=str(self._parameters.files.directory),
            watched=[output for output in self._watched if output[0] in names],
            ack_key=self._ack_keys[request.host].hex(),
            programs_endpoint=self._programs_endpoint if request.is_local else "",
            profile=self._profile and request.is_local,
            renewals=renewals,
            live_from_ns=self._live_from_ns,
        )

    def lose(self, host: str) -> None:
        """Forget a host: the host may join again."""
        with self._changed:
            self._hosts.pop(host, None)

    def missing(self, hosts: list[str]) -> list[str]:
        """Return the hosts among `hosts` not yet ready, after waiting a moment for a change."""
        with self._changed:
            waiting = [host for host in hosts if host not in self._hosts or not self._hosts[host].ready]
            if waiting:
                self._changed.wait(0.05)
            return waiting

    def watching(self, host: str) -> bool:
        """Return whether the observers of `host` have seen the state at time 0."""
        return host in self._hosts and self._hosts[host].watching

    def bonds(self) -> Mapping[str, tuple[BondSide, ...]]:
        """Return the bonds of all hosts' participants, with the numbers found by `configure`."""
        return {name: sides for request in self._hosts.values() for name, sides in request.bonds.items()}

    def pid(self, host: str) -> int:
        """Return the process id of a host; 0 before joining."""
        if host == "hub":
            return os.getpid()
        return self._hosts[host].pid if host in self._hosts else 0
