"""The vectors that hosts send with their acks, passed on to what watches the run."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from hub.observation.monitor import Monitor
from hub.planning.plan import Plan
from hub.transport.host_link import SentVectors
from schemas.errors import ParticipantError
from schemas.vectors import VectorCodec

__all__ = ["HostVectors"]

Groups = Sequence[tuple[str, Sequence[str]]]
"""By number, a participant and its ports."""


class HostVectors:
    """Passes on what hosts with a link have sent; `groups` returns those that a host has reported."""

    def __init__(self, plan: Plan, monitor: Monitor, groups: Callable[[str], Groups]) -> None:
        self._plan, self._monitor, self._groups = plan, monitor, groups
        self._taken: dict[str, list[Callable[[SentVectors], None]]] = {}

    def take(self, host: str, vectors: Sequence[SentVectors]) -> None:
        """Pass on vectors of a host, which has joined; raises ParticipantError if they are not its own."""
        if vectors and host not in self._taken:
            self._taken[host] = [self._taker(name, ports) for name, ports in self._groups(host)]
        for sent in vectors:
            self._taken[host][sent[0]](sent)

    def _taker(self, name: str, port_names: Sequence[str]) -> Callable[[SentVectors], None]:
        planned = self._plan.participants[name]
        ports = [planned.port(port) for port in port_names]
        size = sum(8 * VectorCodec(port).size for port in ports)
        listener = self._monitor.vectors_listener(planned, ports)

        def take(sent: SentVectors) -> None:
            _, step, time_ns, data = sent
            if len(data) != size:
                raise ParticipantError(
                    name, step, f"its host has sent vectors of {len(data)} bytes, expected {size}"
                )
            if listener is not None:
                listener(step, time_ns, data)

        return take
