"""The network link of a device: delay, jitter, loss and outages between device and hub.

For studies of remote operation. Nothing here reads a clock: the caller passes the time, wall or simulated, so
that the same seed and the same messages at the same times give the same arrivals. Random numbers are drawn
for each port and direction separately, two a message.

A *signal* travels like datagrams: a lost message stays lost, and with jitter a message may overtake an
earlier message (the receiver refuses the late message). *Events* travel like TCP: none overtakes another, and
a lost message is sent again until received, each time a round trip later.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from heapq import heappop, heappush
from typing import Any

from pydantic import BaseModel, ConfigDict

from schemas.network_link import NetworkLinkSpec, Outage
from schemas.ports import Port

__all__ = ["Line", "NetworkLink", "NetworkLinkOrder", "describe_link"]


class NetworkLinkOrder(BaseModel):
    """The network link of a device from now on."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    spec: NetworkLinkSpec
    outage_ns: int = 0
    """Lose every message for this long."""


@dataclass
class Line:
    """A port's messages in one direction. All times in nanoseconds since the start of the device's clock.

    A thread may send while another receives: each operation on the heap is atomic in the interpreter.
    """

    link: NetworkLink
    reliable: bool
    chance: random.Random
    _waiting: list[tuple[int, int, Any]] = field(default_factory=list[tuple[int, int, Any]])
    _count: int = 0
    _last_ns: int = 0

    @property
    def is_empty(self) -> bool:
        """Whether no message is on the way."""
        return not self._waiting

    def send(self, now_ns: int, message: Any) -> None:
        """Send a message over the link."""
        self.link.used = True
        spec, draw, luck = self.link.spec, self.chance.random(), self.chance.random()
        arrival_ns = now_ns + spec.delay_ns + round(draw * spec.jitter)
        if self.reliable:
            arrival_ns += max(self.link.cut_until(now_ns) - now_ns, 0)
            while luck < spec.loss:
                arrival_ns += 2 * spec.delay_ns + spec.jitter
                luck = luck / spec.loss or 1.0  # what is left of the number is as random as it was
            self._last_ns = arrival_ns = max(arrival_ns, self._last_ns)
        elif luck < spec.loss or self.link.cut_until(now_ns) > now_ns:
            return
        self._count += 1
        heappush(self._waiting, (arrival_ns, self._count, message))

    def pop_arrivals(self, now_ns: int) -> Iterator[tuple[int, Any]]:
        """Yield time of arrival and message of all new arrivals, in the order of arrival."""
        while self._waiting and self._waiting[0][0] <= now_ns:
            arrival_ns, _, message = heappop(self._waiting)
            yield arrival_ns, message


class NetworkLink:
    """Both directions of all ports of a device.

    Without a spec everything arrives at once; `order` can change the link at any time.
    """

    def __init__(self, spec: NetworkLinkSpec | None) -> None:
        self.spec = spec or NetworkLinkSpec()
        self._lines: dict[tuple[str, str], Line] = {}
        self.used = False
        """Whether the link has ever carried a message: a gateway has hundreds of ports, and most links idle.
        """
        self._outages = list(self.spec.outages)
        self._orders: deque[NetworkLinkOrder] = deque()

    @property
    def clear(self) -> bool:
        """Whether the link neither delays nor loses anything."""
        return not (self.spec.delay_ns or self.spec.jitter or self.spec.loss or self._outages)

    @property
    def idle(self) -> bool:
        """Whether the link is clear and no message is on the way: messages may pass beside the link."""
        return self.clear and (not self.used or all(line.is_empty for line in self._lines.values()))

    def line(self, port: Port) -> Line:
        """Return the line of a port of the device: outputs go to the hub, inputs come from the hub."""
        line = self._lines.get((port.causality, port.name))
        if line is None:
            line = self._lines[port.causality, port.name] = Line(
                self, port.variability == "event", self._random_numbers(port.causality, port.name)
            )
        return line

    def order(self, order: NetworkLinkOrder) -> None:
        """Change the link at the next `settle`; from any thread."""
        self._orders.append(order)

    def settle(self, now_ns: int) -> None:
        """Carry out the orders for messages sent from now on; messages already in flight are not affected."""
        while self._orders:
            order = self._orders.popleft()
            reseeded, self.spec = order.spec.seed != self.spec.seed, order.spec
            self._outages = [
                *self.spec.outages,
                *([Outage.model_construct(at=now_ns, duration=order.outage_ns)] if order.outage_ns else ()),
            ]
            for (causality, name), line in self._lines.items() if reseeded else ():
                line.chance = self._random_numbers(causality, name)

    def cut_until(self, now_ns: int) -> int:
        """Return when the outages around `now_ns` are over; `now_ns` if there is none."""
        until_ns = now_ns
        for outage in sorted(self._outages, key=lambda o: o.at):
            if outage.at <= until_ns < outage.at + outage.duration:
                until_ns = outage.at + outage.duration
        return until_ns

    def _random_numbers(self, causality: str, port: str) -> random.Random:
        return random.Random(f"{self.spec.seed} {causality} {port}")


def describe_link(spec: NetworkLinkSpec, outage_ns: int = 0) -> str:
    """Describe a network link; empty without delay and loss."""
    parts = (
        f"{spec.delay_ns / 1e6:g} ms each way" if spec.delay_ns else "",
        f"up to {spec.jitter / 1e6:g} ms more" if spec.jitter else "",
        f"{100 * spec.loss:g} % lost" if spec.loss else "",
        "outages of the scenario" if spec.outages else "",
        f"nothing at all for {outage_ns / 1e9:g} s" if outage_ns else "",
    )
    return ", ".join(part for part in parts if part)
