"""The link of a device: delay, jitter, loss and outages between it and the hub, for studies of remote
operation.

Nothing here looks at a clock: whoever uses a link says what time it is, wall or simulated, so that the same
seed and the same messages at the same times give the same arrivals. Chance is drawn for each port and
direction by itself, two numbers a message, whatever the others do.

A *signal* travels as datagrams do: what is lost stays lost, and with jitter one message may overtake another
(whoever receives refuses the one that comes late). *Events* travel as over TCP: none overtakes another, and a
lost one is sent again until it is through, each time a round trip later.
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

__all__ = ["Line", "NetworkLink", "NetworkLinkOrder", "in_words"]


class NetworkLinkOrder(BaseModel):
    """What is to lie between a device and the hub from now on."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    spec: NetworkLinkSpec
    outage_ns: int = 0
    """And that nothing gets through for so long."""


@dataclass
class Line:
    """One port's messages in one direction. All times in nanoseconds since the start of the device's clock.

    One thread may send while another takes what has arrived: the interpreter does each operation on the heap
    as one.
    """

    link: NetworkLink
    reliable: bool
    chance: random.Random
    _waiting: list[tuple[int, int, Any]] = field(default_factory=list[tuple[int, int, Any]])
    _count: int = 0
    _last_ns: int = 0

    @property
    def empty(self) -> bool:
        """Say whether nothing is on its way."""
        return not self._waiting

    def send(self, now_ns: int, message: Any) -> None:
        """Put a message on its way."""
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

    def arrived(self, now_ns: int) -> Iterator[tuple[int, Any]]:
        """Yield what has arrived by now and was not yielded before, in the order of arrival, each with its
        time of arrival.
        """
        while self._waiting and self._waiting[0][0] <= now_ns:
            arrival_ns, _, message = heappop(self._waiting)
            yield arrival_ns, message


class NetworkLink:
    """Both directions of all ports of one device. Without a spec everything arrives at once; it can be
    changed at any time.
    """

    def __init__(self, spec: NetworkLinkSpec | None) -> None:
        """Take the link of the scenario."""
        self.spec = spec or NetworkLinkSpec()
        self._lines: dict[tuple[str, str], Line] = {}
        self.used = False
        """Whether anything was ever sent over it: a gateway has hundreds of ports, and most links lie
        nowhere.
        """
        self._outages = list(self.spec.outages)
        self._orders: deque[NetworkLinkOrder] = deque()

    @property
    def clear(self) -> bool:
        """Say whether nothing is between the device and the hub."""
        return not (self.spec.delay_ns or self.spec.jitter or self.spec.loss or self._outages)

    @property
    def idle(self) -> bool:
        """Say whether it is clear and nothing is on its way: what is sent now need not be sent over it."""
        return self.clear and (not self.used or all(line.empty for line in self._lines.values()))

    def line(self, port: Port) -> Line:
        """Return the line of one of the device's ports: outputs go to the hub, inputs come from there."""
        line = self._lines.get((port.causality, port.name))
        if line is None:
            line = self._lines[port.causality, port.name] = Line(
                self, port.variability == "event", self._chance(port.causality, port.name)
            )
        return line

    def order(self, order: NetworkLinkOrder) -> None:
        """Ask for another link from the next time on that somebody looks; from any thread."""
        self._orders.append(order)

    def settle(self, now_ns: int) -> None:
        """Carry out what was ordered: what is sent from now on goes the new way, what is on its way arrives
        as it was to.
        """
        while self._orders:
            order = self._orders.popleft()
            reseeded, self.spec = order.spec.seed != self.spec.seed, order.spec
            self._outages = [
                *self.spec.outages,
                *([Outage.model_construct(at=now_ns, duration=order.outage_ns)] if order.outage_ns else ()),
            ]
            for (causality, name), line in self._lines.items() if reseeded else ():
                line.chance = self._chance(causality, name)

    def cut_until(self, now_ns: int) -> int:
        """Return when the outages in which `now_ns` falls are over; `now_ns` if there is none."""
        until_ns = now_ns
        for outage in sorted(self._outages, key=lambda o: o.at):
            if outage.at <= until_ns < outage.at + outage.duration:
                until_ns = outage.at + outage.duration
        return until_ns

    def _chance(self, causality: str, port: str) -> random.Random:
        return random.Random(f"{self.spec.seed} {causality} {port}")


def in_words(spec: NetworkLinkSpec, outage_ns: int = 0) -> str:
    """Return what lies between a device and the hub; empty: nothing."""
    parts = (
        f"{spec.delay_ns / 1e6:g} ms each way" if spec.delay_ns else "",
        f"up to {spec.jitter / 1e6:g} ms more" if spec.jitter else "",
        f"{100 * spec.loss:g} % lost" if spec.loss else "",
        "outages as the scenario says" if spec.outages else "",
        f"nothing at all for {outage_ns / 1e9:g} s" if outage_ns else "",
    )
    return ", ".join(part for part in parts if part)
