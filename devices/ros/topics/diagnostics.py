"""`/diagnostics`: once a second, how fast the simulation and the gateway's topics are, for ROS monitors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from time import monotonic_ns

from devices.ros.status import Count
from devices.ros.topics.publications import State
from devices.ros.topics.row import Row
from schemas.codec import encode
from schemas.ros import DiagnosticArray, DiagnosticStatus, Header, KeyValue, Time

__all__ = ["DIAGNOSTICS_PERIOD_NS", "DIAGNOSTICS_ROW", "Diagnostics"]

DIAGNOSTICS_ROW = Row("/diagnostics", DiagnosticArray.ros_type, "publish", periodic=True)
"""Row of `/diagnostics`, in no namespace: monitors read a common topic of all programs."""

DIAGNOSTICS_PERIOD_NS = 1_000_000_000
"""Period of ROS's diagnostic_updater by default."""
_OLD_NS = 1_000_000_000
"""Age of a stale snapshot: older states are not published."""
_OK, _STALE = 0, 3


class Diagnostics:
    """The statuses of a gateway: simulation, states and each camera.

    Rates are per second of wall time since the last message.
    """

    def __init__(self, gateway: str, states: Mapping[str, State], published: Iterable[tuple[Row, Count]]):
        """Start to count.

        Args:
            gateway: name of the gateway, the first part of every status's name.
            states: states from the simulation, by port.
            published: the published rows, with their counts.
        """
        self._gateway, self._states = gateway, states
        published = tuple(published)
        self._periodic = [count for row, count in published if row.periodic and row.port is not None]
        self._pictures = [(row, count) for row, count in published if row.is_picture]
        self._last_ns = monotonic_ns()
        self._before: dict[object, int] = {}
        self._simulated: tuple[int, int] | None = None
        """Stamp of the newest stamped event (ns of simulated time), and time of arrival (ns)."""
        self._measured: tuple[int, int] | None = None

    def note_stamp(self, simulated_ns: int) -> None:
        """Note the stamp of an event from the simulation: only events carry the simulated time."""
        self._simulated = simulated_ns, monotonic_ns()

    def cdr(self, stamp_ns: int) -> bytes | None:
        """Return the statuses with this stamp (wall time, ns)."""
        now_ns = monotonic_ns()
        seconds, self._last_ns = max(now_ns - self._last_ns, 1) * 1e-9, now_ns
        statuses = [
            self._simulation_status(now_ns, seconds),
            self._published_states(seconds),
            *self._cameras(seconds),
        ]
        header = Header(stamp=Time.from_ns(stamp_ns))
        return encode(DiagnosticArray(header=header, status=statuses))

    def _simulation_status(self, now_ns: int, seconds: float) -> DiagnosticStatus:
        written = [state.written_ns for state in self._states.values() if state.written_ns]
        rate = max(
            (self._rate(port, state.writes, seconds) for port, state in self._states.items()), default=0
        )
        values = {"snapshots per second": f"{rate:.1f}"}
        if (factor := self._real_time_factor()) is not None:
            values["real-time factor"] = f"{factor:.3f}"
        if not written:
            return self._status("simulation", _STALE, "no snapshot yet", values)
        age_ns = now_ns - max(written)
        values["age of the snapshot (s)"] = f"{age_ns * 1e-9:.3f}"
        if age_ns > _OLD_NS:
            return self._status("simulation", _STALE, f"no snapshot for {age_ns * 1e-9:.1f} s", values)
        return self._status("simulation", _OK, f"{rate:.1f} snapshots per second", values)

    def _real_time_factor(self) -> float | None:
        """Return simulated time per wall time between the last events of two messages; None if unknown."""
        before, newest = self._measured, self._simulated
        self._measured = newest
        if before is None or newest is None or newest[1] <= before[1] or newest[0] < before[0]:
            return None
        return (newest[0] - before[0]) / (newest[1] - before[1])

    def _published_states(self, seconds: float) -> DiagnosticStatus:
        rates = [self._rate(count, count.messages, seconds) for count in self._periodic]
        active = [rate for rate in rates if rate]
        values = {"topics": str(len(active))}
        if active:
            values |= {"slowest (Hz)": f"{min(active):.1f}", "fastest (Hz)": f"{max(active):.1f}"}
        text = f"{min(active):.1f} Hz at least" if active else "none are published"
        return self._status("states", _OK if active else _STALE, text, values)

    def _cameras(self, seconds: float) -> Iterable[DiagnosticStatus]:
        for camera in dict.fromkeys(row.owner for row, _ in self._pictures):
            rates = {
                row.name: self._rate(count, count.messages, seconds)
                for row, count in self._pictures
                if row.owner == camera
            }
            fastest = max(rates.values())
            values = {f"{name} (Hz)": f"{rate:.1f}" for name, rate in rates.items()}
            text = f"{fastest:.1f} pictures per second" if fastest else "no pictures"
            yield self._status(f"camera {camera}", _OK if fastest else _STALE, text, values)

    def _rate(self, counted: object, count: int, seconds: float) -> float:
        before, self._before[counted] = self._before.get(counted, 0), count
        return (count - before) / seconds

    def _status(self, part: str, level: int, text: str, values: Mapping[str, str]) -> DiagnosticStatus:
        return DiagnosticStatus(
            level=level,
            name=f"{self._gateway}: {part}",
            message=text,
            hardware_id="trocar",
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
