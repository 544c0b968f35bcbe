"""A recording as the source of pages: any instant, by the recording's indexes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property, lru_cache
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from hub.participant import Params
from hub.recording.bond_trace import BondTrace, Contact
from hub.recording.moments import Moments
from hub.recording.output_port import output_port
from hub.recording.recording import STATUS_TOPIC, Recording
from hub.recording.series import Series
from hub.recording.trust import trusted_parameters
from schemas.codec import decode
from schemas.errors import MessageError, RecordingError, TrocarError
from schemas.ports import Port
from schemas.readable import counted
from schemas.scenario import Scenario
from schemas.trocar_msgs import SessionStatus
from schemas.vectors import Vector
from webconsole.arrows import BondArrows
from webconsole.gauges import GAUGES, HUB, hub_outlets
from webconsole.log import Entries, Entry, Tally, is_logged
from webconsole.pyramid import Pyramid
from webconsole.source import Outlet, Value

__all__ = ["Recorded"]

_SERIES_KEPT = 16
_CONTACT_N = 0.02
"""Least force of a contact, N: twice the force of a step of the recorded hand in free motion."""


class Recorded:
    """The source of the pages of a recording."""

    kind = "recording"
    generation = 1
    guided = None

    def __init__(self, path: Path, *, trust: bool = False) -> None:
        """Open the recording; raises RecordingError if it is not of a session.

        `trust` allows a drawn scene of changed files.
        """
        self.recording, self._trust = Recording(path), trust
        self.scenario: Scenario | None = self.recording.scenario()
        self._moments = Moments(self.recording)
        self._lock = Lock()
        self._topics: dict[str, str] = {}
        self.outlets = tuple(self._find_outlets())
        self._series = lru_cache(maxsize=_SERIES_KEPT)(self._read_series)
        self._pyramid = lru_cache(maxsize=_SERIES_KEPT)(self._read_pyramid)

    def _find_outlets(self) -> Iterator[Outlet]:
        """Yield the recorded outputs: as declared, else by the first messages."""
        recorded = self.recording
        declared: dict[str, Port] = {}
        if "plan.json" in recorded.attachments:
            for planned in recorded.plan().participants.values():
                declared |= {f"{planned.name}.{port.name}": port for port in planned.ports}
        for name, type_name in recorded.ports.items():
            series = recorded[name]
            first = next(recorded.messages(series.topic), None)
            if first is None:
                continue
            participant, _, port_name = name.partition(".")
            self._topics[name] = series.topic
            port = declared.get(name)
            if port is None or port.type != type_name:
                port = output_port(port_name, type_name, first.payload)
            yield Outlet(participant, port)
        for outlet in hub_outlets(self.scenario) if self.scenario else ():
            if (name := f"/{HUB}/{outlet.port.name}") in recorded.topics:
                self._topics[outlet.name] = name
                yield outlet

    @cached_property
    def state(self) -> Mapping[str, Any]:
        """Name of the session, and when the recording begins and ends (s)."""
        start, end = self._moments.span_ns
        statuses, problems = self._read_statuses
        last = statuses[-1][1] if statuses else None
        return {
            "session": self.recording.scenario().name if last is None else last.session,
            "state": "recording" if last is None or last.state == "done" else f"recording, {last.state}",
            "file": str(self.recording.file),
            "start": start / 1e9,
            "end": end / 1e9,
            "late": 0 if last is None else last.late_steps,
            "dropped": 0 if last is None else last.dropped_messages,
            "detail": "" if last is None else last.detail,
            "problems": problems,
        }

    def params(self, participant: str) -> Params:
        """Return the validated parameters of a participant; raises as `trusted_parameters` does."""
        parameters = trusted_parameters(self.recording, [participant], trust=self._trust)
        return parameters.validate_last(participant)

    @cached_property
    def _read_statuses(self) -> tuple[list[tuple[int, SessionStatus]], list[str]]:
        """Return the statuses with times (ns), and a sentence about damaged statuses."""
        found, damaged = list[tuple[int, SessionStatus]](), list[str]()
        try:
            messages = self.recording.messages(STATUS_TOPIC) if STATUS_TOPIC in self.recording.topics else ()
            for message in messages:
                try:
                    found.append((message.time_ns, decode(SessionStatus, message.payload)))
                except MessageError as error:
                    damaged.append(str(error))
        except RecordingError as error:
            damaged.append(str(error))
        if not damaged:
            return found, []
        return found, [f"{len(damaged)} statuses of the session cannot be read, the first: {damaged[0]}"]

    def want(self, names: frozenset[str]) -> None:
        """Nothing has to be asked for."""

    def newest(self, name: str, time_ns: int | None) -> Value | None:
        """Return the newest message of an outlet up to a simulated time, by default the end."""
        found = self._moments.newest(
            self._topics[name], self._moments.span_ns[1] if time_ns is None else time_ns
        )
        return None if found is None else Value(found.time_ns, found.payload)

    def first(self, name: str) -> Value | None:
        """Return the first message of an outlet."""
        found = next(self.recording.messages(self._topics[name]), None)
        return None if found is None else Value(found.time_ns, found.payload)

    def series(self, name: str, start_s: float, end_s: float, buckets: int) -> tuple[list[str], Vector]:
        """Return columns and rows of a numeric outlet between two times, shape (n, 1 + columns).

        The first number of a row is the time, s. Of more values than two for each bucket, the least and the
        greatest of each column in each bucket are kept, so that no peak is lost. Raises RecordingError.
        """
        with self._lock:
            columns, pyramid = self._pyramid(name)
        return columns, pyramid.rows(start_s, end_s, buckets)

    def contacts(self, bond: BondArrows) -> list[Contact]:
        """Return the contacts of a bond with a single point. Raises RecordingError."""
        with self._lock:
            place, force = self._series(bond.place), self._series(bond.force)
        return BondTrace.of_series(bond.name, place.time, place.values, force.time, force.values).contacts

    def _read_series(self, name: str) -> Series:
        if name not in self.recording:
            raise RecordingError(f"'{self.recording.file}' has no port '{name:.80}'")
        series = self.recording[name]
        series.values  # noqa: B018  # read it here, within the lock
        return series

    def _read_pyramid(self, name: str) -> tuple[list[str], Pyramid]:
        participant, _, port = name.partition(".")
        if participant != HUB or name not in self._topics:
            series = self._series(name)
            columns = list(series.columns) if series.values.shape[1] > 1 else [""]
            return columns, Pyramid(series.time, series.values)
        gauge = GAUGES[self.recording.topics[self._topics[name]]]
        messages = [*self.recording.messages(f"/{HUB}/{port}")]
        times, values = [one.time_ns / 1e9 for one in messages], [gauge.read(one.payload) for one in messages]
        return list(gauge.columns), Pyramid(np.array(times), np.array(values))

    @cached_property
    def events(self) -> list[Entry]:
        """Return the events of tasks, tissue, devices and lost inputs; by time."""
        parts = (
            self._messages(),
            self._contacts(),
            _readable_entries(self._stale(), "session"),
            self._statuses(),
        )
        return sorted((entry for part in parts for entry in part), key=lambda one: one.time_s)

    def _messages(self) -> Iterator[Entry]:
        lines = Entries()
        for outlet in self.outlets:
            if is_logged(outlet.port):
                yield from _readable_entries(self._lines_of(outlet, lines), outlet.name)

    def _lines_of(self, outlet: Outlet, lines: Entries) -> Iterator[Entry]:
        """Yield the lines of an outlet, and a line about all damaged messages."""
        damaged = list[Entry]()
        for message in self.recording.messages(self._topics[outlet.name]):
            try:
                yield from lines.lines_of(outlet, Value(message.time_ns, message.payload))
            except MessageError as error:
                damaged.append(Entry(message.time_ns / 1e9, "warn", outlet.name, str(error)))
        if damaged:
            text = f"{len(damaged)} messages cannot be read, the first: {damaged[0].text}"
            yield damaged[0]._replace(text=text)

    def _contacts(self) -> Iterator[Entry]:
        """Yield when something was touched and let go: the wrench of a bond's force side."""
        for bond in self.scenario.bonds if self.scenario else ():
            name = f"{bond.force}/wrench"
            if name in self.recording:
                yield from _readable_entries(self._contacts_of(name), name)

    def _contacts_of(self, name: str) -> Iterator[Entry]:
        series = self._series(name)
        force = np.linalg.norm(series.values[:, :3], axis=1)
        touches = force > _CONTACT_N
        for at in np.flatnonzero(touches[1:] != touches[:-1]) + 1:
            text = f"contact, {force[at]:.2g} N" if touches[at] else "contact ends"
            yield Entry(float(series.time[at]), "info", name, text)

    def _stale(self) -> Iterator[Entry]:
        """Yield the ends and returns of a device's samples."""
        stale: dict[str, bool] = {}
        for grant in self.recording.grants():
            for sample in grant.inlets:
                name = f"{sample.participant}.{sample.port}"
                if stale.get(name, False) != sample.stale:
                    stale[name] = sample.stale
                    text = "is stale: the arm holds" if sample.stale else "is there again"
                    yield Entry(grant.start_ns / 1e9, "warn" if sample.stale else "info", name, text)

    def _statuses(self) -> Iterator[Entry]:
        """Yield late steps and refused messages, summed up, at the time of the next status."""
        late, refused = Tally(), Tally()
        statuses = self._read_statuses[0]
        for i, (time_ns, status) in enumerate(statuses):
            at, last = time_ns / 1e9, i == len(statuses) - 1
            if more := late.more(status.late_steps, at, last=last):
                yield Entry(at, "warn", "session", counted(more, "late step"))
            if more := refused.more(status.dropped_messages, at, last=last):
                yield Entry(at, "warn", "session", f"{counted(more, 'message')} refused")

    def close(self) -> None:
        """Files are opened for each look alone."""


def _readable_entries(entries: Iterator[Entry], source: str) -> Iterator[Entry]:
    """Yield entries as far as readable, and then why no further."""
    time_s = 0.0
    try:
        for entry in entries:
            time_s = entry.time_s
            yield entry
    except TrocarError as error:
        yield Entry(time_s, "warn", source, f"not shown from here on: {error}")
