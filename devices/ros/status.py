"""Status of a gateway, as shown by `trocar ros`: message counts, rates and clients."""

from __future__ import annotations

from collections.abc import Iterable
from time import monotonic_ns

from devices.ros.topics.row import Row
from devices.ros.transport import Client
from schemas.trocar_msgs import GatewayClient, GatewayStatus, GatewayTopic

__all__ = ["Count", "StatusCounters"]


class Count:
    """Counts of a row: messages, refused messages, and the reason of the last refusal."""

    __slots__ = ("messages", "reason", "refused")

    def __init__(self) -> None:
        self.messages = self.refused = 0
        self.reason = ""


class StatusCounters:
    """Counts of all rows of a gateway."""

    def __init__(self, kind: str, rows: Iterable[Row]) -> None:
        self._kind = kind
        self._counts = {row: Count() for row in rows}
        self._before = dict.fromkeys(self._counts, 0)
        self._asked_ns = monotonic_ns()

    def __getitem__(self, row: Row) -> Count:
        """Return the count of a row."""
        return self._counts[row]

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
