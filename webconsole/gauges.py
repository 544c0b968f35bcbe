"""Numbers of a session from the hub itself: the bonds' energy books, pace and latencies.

For a page these are outputs of `hub`: `hub.energy/BOND` and `hub.status`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from hub.participant import signal_out
from schemas.codec import decode
from schemas.scenario import Scenario
from schemas.trocar_msgs import CouplingEnergy, SessionStatus
from schemas.vectors import Vector
from webconsole.source import Outlet

__all__ = ["GAUGES", "HUB", "Gauge", "hub_outlets"]

HUB = "hub"
_WAYS = {
    "step": "grant to state",
    "device": "device to grant",
    "force": "state to force",
    "picture": "state to picture",
}
"""Ways of `schemas.trocar_msgs.Latency` by the name of their plot; of several streams the slowest counts."""


class Gauge(NamedTuple):
    """Reader of the numbers of a message type."""

    columns: tuple[str, ...]
    """`field.name`, or a name alone."""
    units: dict[str, str]
    """Units by field."""
    text: str
    read: Callable[[bytes], Vector]
    """Raises MessageError if the message is not valid; NaN: there is none."""


def hub_outlets(scenario: Scenario) -> Iterator[Outlet]:
    """Yield the outlets of the hub itself in a session."""
    for bond in scenario.bonds:
        port = signal_out(f"energy/{bond.name}", CouplingEnergy)
        yield Outlet(HUB, port)
    yield Outlet(HUB, signal_out("status", SessionStatus))


def _energy(payload: bytes) -> Vector:
    book = decode(CouplingEnergy, payload)
    return np.array([book.motion_work_j, book.force_work_j, book.residual_j])


def _status(payload: bytes) -> Vector:
    status = decode(SessionStatus, payload)
    numbers = [status.real_time_factor, float(status.late_steps), float(status.dropped_messages)]
    for way in _WAYS.values():
        found = [one for one in status.latencies if one.way == way and one.count]
        numbers.append(1e3 * max((one.p50_s for one in found), default=np.nan))
        numbers.append(1e3 * max((one.p99_s for one in found), default=np.nan))
    return np.array(numbers)


GAUGES = {
    CouplingEnergy.ros_type: Gauge(
        ("book.given by the motion side", "book.received by the force side", "residual.residual"),
        {"book": "J", "residual": "J"},
        "Energy book of the bond: work since the start, and what the coupling created or lost.",
        _energy,
    ),
    SessionStatus.ros_type: Gauge(
        (
            "pace.of real time",
            "counts.late steps",
            "counts.refused messages",
            *(f"{name} latency.{share}" for name in _WAYS for share in ("p50", "p99")),
        ),
        {f"{name} latency": "ms" for name in _WAYS},
        "Pace and counts of the session, and its latencies since the start.",
        _status,
    ),
}
"""Gauges by ROS type."""
