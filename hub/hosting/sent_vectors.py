"""What the hub records or measures of a host that it has started: vectors that go with the acks."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from hub.hosting.outputs import VectorsListener
from hub.planning.plan import PlannedParticipant
from hub.transport.host_link import SentVectors
from schemas.ports import Port

__all__ = ["VectorsToSend"]


class VectorsToSend:
    """Listens to the outputs of a host, and keeps their vectors until the acks of a grant are sent.

    `wanted` are participant and port of the outputs that the hub uses. Vectors that are due together are
    one group; all of a group are sent if one is wanted.
    """

    def __init__(self, wanted: Collection[tuple[str, str]]) -> None:
        self._wanted = set(wanted)
        self.groups: list[tuple[str, list[str]]] = []
        """By number: a participant, and its ports whose vectors are sent one after the other."""
        self._kept: list[SentVectors] = []

    def watches(self, participant: str, port: str) -> bool:
        """Return whether the hub uses the values of an output."""
        return (participant, port) in self._wanted

    def listener(self, planned: PlannedParticipant, port: Port) -> None:
        """Return None: messages and events have keys of their own on Zenoh."""

    def vectors_listener(self, planned: PlannedParticipant, ports: Sequence[Port]) -> VectorsListener | None:
        """Return what keeps vectors of a participant; None if the hub uses none of them."""
        if not any(self.watches(planned.name, port.name) for port in ports):
            return None
        group = len(self.groups)
        self.groups.append((planned.name, [port.name for port in ports]))

        def keep(step: int, time_ns: int, data: bytes) -> None:
            self._kept.append((group, step, time_ns, data))

        return keep

    def take(self) -> list[SentVectors]:
        """Return what has been kept since it was taken last."""
        kept, self._kept = self._kept, []
        return kept
