"""How much goes through a gateway: what `trocar ros` shows."""

from __future__ import annotations

from collections.abc import Iterable
from time import monotonic_ns

from devices.ros.topics.row import Row
from devices.ros.transport import Client
from schemas.trocar_msgs import GatewayClient, GatewayStatus, GatewayTopic

__all__ = ["Count", "Traffic"]


class Count:
    """Of one row: messages so far, those of them that were refused, and why the last one was."""

    __slots__ = ("messages", "reason", "refused")

    def __init__(self) -> None:
        """Begin with none."""
        self.messages = self.refused = 0
        self.reason = ""


class Traffic:
    """Of all rows of one gateway."""

    def __init__(self, kind: str, rows: Iterable[Row]) -> None:
        """Take the gateway's kind and table."""
        self._kind = kind
        self._counts = {row: Count() for row in rows}
        self._before = dict.fromkeys(self._counts, 0)
        self._looked_ns = monotonic_ns()

    def __getitem__(self, row: Row) -> Count:
        """Return what to count a row's messages with."""
        return self._counts[row]

    def status(self, clients: Iterable[Client]) -> GatewayStatus:
        """Return what has gone through, with rates since the last time this was asked."""
        now_ns = monotonic_ns()
        seconds, self._looked_ns = max(now_ns - self._looked_ns, 1) / 1e9, now_ns
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
            clients=[GatewayClient(name=c.name, address=c.address) for c in clients],
            topics=topics,
        )
