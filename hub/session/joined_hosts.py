"""Who belongs to a session: hosts join, report ready or failed, and may be lost; the first failure ends the
run.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from hub.planning.plan import Plan
from hub.transport.control_messages import Empty, JoinReply, JoinRequest
from hub.transport.zenoh_session import LEASE_MS
from schemas.errors import MessageError, ParticipantError
from schemas.ports import BondSide
from schemas.scenario import Scenario

__all__ = ["Failures", "JoinedHosts"]


class Failures:
    """The first failure that any thread reports; `wake` makes the step loop look."""

    def __init__(self, wake: Callable[[], None]) -> None:
        self._wake = wake
        self._lock = threading.Lock()
        self.first: ParticipantError | None = None

    def report(self, participant: str, step: int, cause: str) -> None:
        """Report that `participant` failed in `step`; only the first report counts, the others are its
        consequences.
        """
        with self._lock:
            if self.first is not None:
                return
            self.first = ParticipantError(participant, step, cause)
        self._wake()

    def check(self) -> None:
        """Raise the first failure, if there is one."""
        if self.first is not None:
            raise self.first


class JoinedHosts:
    """The hosts of a session other than the hub's own."""

    def __init__(
        self,
        scenario: Scenario,
        plan: Plan,
        directory: Path,
        run: int,
        watched: Sequence[tuple[str, str]],
        failed: Callable[[str, str], None],
    ) -> None:
        """`watched`: outputs that the hub listens to; `failed` is told the participant and the cause that a
        host reports.
        """
        self._watched = list(watched)
        self._scenario = scenario
        self._plan = plan
        self._directory = directory
        self._run = run
        self._failed = failed
        self._hosts: dict[str, JoinRequest] = {}
        self._admissions = 0
        self._changed = threading.Condition()

    def join(self, request: JoinRequest) -> JoinReply | Empty:
        """Answer a host that presents itself, is ready or has failed; raises MessageError to refuse it."""
        names = [name for name, planned in self._plan.participants.items() if planned.host == request.host]
        if not names or request.host == "hub":
            hosts = (
                ", ".join(host for host in self._plan.hosts() if host != "hub") or "none but the hub's own"
            )
            raise MessageError(
                f"session '{self._scenario.name}' has no host '{request.host}'; it has {hosts}"
            )
        with self._changed:
            known = self._hosts.get(request.host)
            if known is not None and known.pid != request.pid:
                lease_s = LEASE_MS / 1e3
                raise MessageError(
                    f"host '{request.host}' is here already, as process {known.pid}: end that one, or wait"
                    f" {lease_s:g} s if it is cut off"
                )
            self._hosts[request.host] = request
            self._admissions += 1
            self._changed.notify_all()
        if request.failed:
            participant, _, cause = request.failed.partition(": ")
            self._failed(participant, cause)
        if request.ready or request.failed:
            return Empty()
        params = {name: self._scenario.participants[name].params for name in names}
        far = request.host.startswith("remote/")
        return JoinReply(
            session=self._scenario.name,
            run=self._run,
            admission=self._admissions,
            plan=self._plan.seen_from(request.host) if far else self._plan,
            params=params,
            directory=str(self._directory),
            watched=[output for output in self._watched if output[0] in names],
        )

    def lose(self, host: str) -> None:
        """Forget a host, so that it may join again."""
        with self._changed:
            self._hosts.pop(host, None)

    def missing(self, hosts: list[str]) -> list[str]:
        """Return which of `hosts` are not ready yet, after waiting a moment for a change."""
        with self._changed:
            waiting = [host for host in hosts if host not in self._hosts or not self._hosts[host].ready]
            if waiting:
                self._changed.wait(0.05)
            return waiting

    def bonds(self) -> Mapping[str, tuple[BondSide, ...]]:
        """Return the bonds of all hosts' participants, with the numbers that are known once they are
        configured.
        """
        return {name: sides for request in self._hosts.values() for name, sides in request.bonds.items()}

    def pid(self, host: str) -> int:
        """Return the process id of a host; 0 while it has not joined."""
        if host == "hub":
            return os.getpid()
        return self._hosts[host].pid if host in self._hosts else 0
