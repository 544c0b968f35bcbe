"""Events of an organ: cut, torn and burnt tissue, gathered along the way of an instrument."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from engines.tissue.organs.params import OrganParams
from hub.participant import event_out, signal_out
from schemas.ports import Port
from schemas.ros import Header, Point, Time
from schemas.trocar_msgs import TissueEvent
from schemas.vectors import Vector

__all__ = ["TissueEvents", "change_ports"]

_UNITS = {"cut": "m^2", "torn": "m^2", "burnt": "m^3", "detached": "m^2"}
"""Unit of the size by kind."""
_KINDS = tuple(_UNITS)
_PAUSE_NS = 100_000_000
"""Time without a change that ends an event."""
_LONGEST_NS = 500_000_000
"""Longest time from the first to the last change of an event."""
_NONE = -1
"""Time of no change."""


def change_ports(organs: Mapping[str, OrganParams]) -> tuple[Port, ...]:
    """Return the ports of the events of organs, and of sums of cuts."""
    happened, since = (
        "tissue that was cut, torn, burnt or detached, that bleeds or is clipped",
        "by edges since time 0",
    )
    events = (event_out(f"{organ}/events", TissueEvent, happened, frame="world") for organ in organs)
    cut = (
        port
        for name, organ in organs.items()
        if organ.cutting
        for port in (
            signal_out(f"{name}/cut_area", description=f"area swept {since}", unit="m^2"),
            signal_out(f"{name}/cut_work", description=f"work of cutting {since}", unit="J"),
            signal_out(f"{name}/loose", description="share of the mass without a way to an anchor"),
        )
    )
    return *events, *cut


class TissueEvents:
    """Changes summed by kind and instrument; a sum is an event after a pause, at the latest after 0.5 s."""

    def __init__(self, probes: Sequence[str] = ()) -> None:
        """`probes`: the probe of every sphere."""
        self._names = [*dict.fromkeys(probes), ""]
        self._number = np.array([self._names.index(probe) for probe in (*probes, "")])
        """Number of the instrument of every sphere; the last is that of none."""
        rows = len(_KINDS), len(self._names)
        self._sums: Vector = np.zeros((*rows, 4))
        """Size, and sum of sizes times places (m), by kind and instrument."""
        self._times: NDArray[np.int64] = np.full((*rows, 2), _NONE)
        """First and last change, ns."""
        self._is_fresh: NDArray[np.bool_] = np.zeros(rows, np.bool_)
        """Changes of the present step."""
        self._latest: NDArray[np.int64] = np.full(2, _NONE)
        """Kind and instrument of the latest change."""
        self._is_open = False
        """Whether a change is not over; else a step costs nothing."""
        self._said: list[tuple[str, str, Vector, float, str]] = []
        """Kind, instrument, place, size and unit of the single events of the present step."""

    def add(self, kind: str, sizes: Vector, places: Vector, spheres: NDArray[np.integer]) -> None:
        """Add changes of the present step.

        sizes: shape (n,). places: m, in `world`, shape (n, 3). spheres: number of the acting sphere, -1 for
        none, shape (n,).
        """
        row, instruments = _KINDS.index(kind), self._number[spheres]
        np.add.at(self._sums[row], instruments, np.column_stack([sizes, sizes[:, None] * places]))
        self._is_fresh[row, instruments] = self._is_open = True
        self._latest[:] = row, np.bincount(instruments, sizes).argmax()

    @property
    def latest(self) -> tuple[str, str]:
        """Kind and instrument of the latest change; empty: there was none, or no instrument."""
        kind, instrument = int(self._latest[0]), int(self._latest[1])
        return ("", "") if kind == _NONE else (_KINDS[kind], self._names[instrument])

    def say(self, kind: str, instrument: str, place: Vector, size: float, unit: str) -> None:
        """Add a single event of the present step. `place`: m, in `world`, shape (3,)."""
        self._said.append((kind, instrument, place, size, unit))

    def finish(self, time_ns: int) -> tuple[TissueEvent, ...]:
        """End the step at `time_ns`; return the events that are over."""
        if not self._is_open and not self._said:
            return ()
        first, last = self._times[..., 0], self._times[..., 1]
        if self._is_fresh.any():
            first[self._is_fresh & (first == _NONE)] = time_ns
            last[self._is_fresh] = time_ns
            self._is_fresh[:] = False
        over = (first != _NONE) & ((time_ns - last >= _PAUSE_NS) | (time_ns - first >= _LONGEST_NS))
        if not over.any() and not self._said:
            return ()
        gathered = tuple(self._event(row, instrument) for row, instrument in np.argwhere(over).tolist())
        single = tuple(_event(time_ns, *said) for said in self._said)
        self._sums[over], self._times[over] = 0.0, _NONE
        self._said.clear()
        self._is_open = bool((first != _NONE).any())
        return gathered + single

    def _event(self, row: int, instrument: int) -> TissueEvent:
        size, time_ns = float(self._sums[row, instrument, 0]), int(self._times[row, instrument, 1])
        place, kind = self._sums[row, instrument, 1:] / size, _KINDS[row]
        return _event(time_ns, kind, self._names[instrument], place, size, _UNITS[kind])

    @property
    def state(self) -> tuple[NDArray[np.generic], ...]:
        """Sums, times and latest change between steps, to be written."""
        return self._sums, self._times, self._latest

    def restore(self, parts: Iterator[bytes]) -> None:
        """Go back to a saved `state`."""
        for array in self.state:
            array[...] = np.frombuffer(next(parts), array.dtype).reshape(array.shape)
        self._is_open = True


def _event(time_ns: int, kind: str, instrument: str, place: Vector, size: float, unit: str) -> TissueEvent:
    x, y, z = place.tolist()
    return TissueEvent(
        header=Header(stamp=Time.from_ns(time_ns), frame_id="world"),
        kind=kind,
        instrument=instrument,
        position=Point(x=x, y=y, z=z),
        size=size,
        unit=unit,
    )
