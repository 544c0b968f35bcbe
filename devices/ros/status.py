"""Status of a gateway, as shown by `trocar ros`: message counts, rates, refusals and clients."""

from __future__ import annotations

import re
from collections.abc import Iterable
from time import monotonic_ns

from devices.ros.topics.row import Row
from devices.ros.transport import Client
from schemas.trocar_msgs import GatewayClient, GatewayStatus, GatewayTopic

__all__ = ["Count", "StatusCounters"]


_REFUSAL = re.compile(
    r"(?P<command>[\w/]+)(?: [^:]*?)? refused:? (?P<reason>.*?)(?: \((?P<times>\d+) times\))?", re.DOTALL
)
"""What a controller says on `error` or `warning` of a refused command, after the arm's name."""


class Count:
    """Counts of a row: messages, refused messages, the last refusal's reason, the last accepted client."""

    __slots__ = ("client", "messages", "reason", "refused")

    def __init__(self) -> None:
        self.messages = self.refused = 0
        self.reason = self.client = ""

    def refuse(self, reason: str, times: int = 1) -> None:
        """Count a refusal: of the gateway, or of a controller behind it."""
        self.refused = min(self.refused + times, self.messages)
        self.reason = reason


class StatusCounters:
    """Counts of all rows of a gateway."""

    def __init__(self, kind: str, rows: Iterable[Row]) -> None:
        self._kind = kind
        self._counts = {row: Count() for row in rows}
        self._commands = {(row.owner, row.name): count for row, count in self._counts.items()}
        self._before = dict.fromkeys(self._counts, 0)
        self._asked_ns = monotonic_ns()

    def __getitem__(self, row: Row) -> Count:
        """Return the count of a row."""
        return self._counts[row]

    def note_report(self, owner: str, text: str) -> None:
        """Count a program's command that a controller has refused, by the report on the owner's topic."""
        found = _REFUSAL.fullmatch(text.removeprefix(f"{owner}: "))
        count = None if found is None else self._commands.get((owner, found["command"]))
        if found is not None and count is not None and count.client:
            count.refuse(f"{found['reason']} (to {count.client})", int(found["times"] or 1))

    def status(self, clients: Iterable[Client]) -> GatewayStatus:
        """Return the status, with rates since the last call."""
        now_ns = monotonic_ns()
        seconds, self._asked_ns = max(now_ns - self._asked_ns, 1) / 1e9, now_ns
        topics: list[GatewayTopic] = []
        for row, count in self._counts.items():
            if not count.messages:
                continue
            rate, self._before[row] = (count.messages - self._before[row]) / seconds, count.messages
            topics.append(
                GatewayTopic(
                    topic=row.topic,
                    way=row.way,
                    rate=rate,
                    messages=count.messages,
                    refused=count.refused,
                    reason=count.reason,
                )
            )
        return GatewayStatus(
            kind=self._kind,
            clients=[GatewayClient(name=client.name, address=client.address) for client in clients],
            topics=topics,
        )
