"""Measured joint states prepared for a regression: a common clock, no noise, accelerations.

Positions and efforts are put on a uniform clock by linear interpolation, then passed forward and backward
through a Butterworth low-pass (no phase shift; Swevers, Verdonck, De Schutter, "Dynamic model identification
for industrial robots", IEEE Control Systems 27(5), 2007). Velocities and accelerations are central
differences of the filtered positions, consistent with the positions. The regressor passes the same
filter as the efforts, as friction changes faster than the cut-off when a joint turns back (Gautier,
"Dynamic identification of robots with power model", ICRA 1997).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import butter, sosfiltfilt

from schemas.errors import RecordingError
from schemas.vectors import Vector

__all__ = ["LEAST_DURATION", "ORDER", "Measured", "Samples", "filter_signals"]

ORDER = 4
"""Order of the Butterworth low-pass in each direction."""
LEAST_DURATION = 5.0
"""Least duration of a recording, s: a period of an exciting motion."""
_EDGE_PERIODS = 2.0
"""Unused time at both ends, in periods of the cut-off frequency."""


class Measured(NamedTuple):
    """Joint states as recorded; N messages, n joints."""

    time: Vector
    """s, shape (N,), increasing."""
    position: Vector
    """rad and m, shape (N, n)."""
    effort: Vector
    """N m and N, shape (N, n)."""


class Samples(NamedTuple):
    """Filtered joint states on a uniform clock, each of shape (N, n); rad, m, s, N m, N."""

    time: Vector
    q: Vector
    dq: Vector
    ddq: Vector
    effort: Vector
    cutoff: float
    """Hz, of the low-pass."""

    def low_passed(self, values: Vector) -> Vector:
        """Return `values` of these samples, N rows, as the efforts were filtered."""
        return _low_passed(values, float(self.time[1] - self.time[0]), self.cutoff)

    @property
    def inner(self) -> slice:
        """Return the samples away from the ends, where the filter has no neighbours."""
        edge = int(np.ceil(_EDGE_PERIODS / (self.cutoff * float(self.time[1] - self.time[0]))))
        return slice(edge, len(self.time) - edge)

    @property
    def kept_count(self) -> int:
        """Return how many these are."""
        return max(0, self.inner.stop - self.inner.start)


def filter_signals(measured: Measured, cutoff: float, rate: float) -> Samples:
    """Return `measured` below the frequency `cutoff` (Hz), at most `rate` samples per second.

    Raises RecordingError for numbers not finite, times not increasing, and a recording too short or too slow
    for the cut-off.
    """
    _check(measured, cutoff)
    step = float(np.median(np.diff(measured.time)))
    clock = np.arange(measured.time[0], measured.time[-1], step)
    q, effort = (
        _low_passed(_resample_signals(clock, measured.time, values), step, cutoff)
        for values in (measured.position, measured.effort)
    )
    dq, ddq = np.zeros_like(q), np.zeros_like(q)
    dq[1:-1] = (q[2:] - q[:-2]) / (2.0 * step)
    ddq[1:-1] = (q[2:] - 2.0 * q[1:-1] + q[:-2]) / step**2
    kept = slice(None, None, max(1, round(1.0 / (rate * step))))
    return Samples(clock[kept], q[kept], dq[kept], ddq[kept], effort[kept], cutoff)


def _resample_signals(clock: Vector, time: Vector, values: Vector) -> Vector:
    result = np.empty((len(clock), values.shape[1]))
    for i in range(values.shape[1]):
        result[:, i] = np.interp(clock, time, values[:, i])
    return result


def _low_passed(values: Vector, step: float, cutoff: float) -> Vector:
    low_pass = butter(ORDER, cutoff, fs=1.0 / step, output="sos")
    result: Vector = sosfiltfilt(low_pass, values, axis=0)
    return result


def _check(measured: Measured, cutoff: float) -> None:
    for what, values in zip(("time", "position", "effort"), measured, strict=True):
        if not np.isfinite(values).all():
            row = int(np.argwhere(~np.isfinite(values))[0][0])
            raise RecordingError(f"{what} of row {row} is not finite; remove these rows from the recording")
    steps = np.diff(measured.time)
    if len(steps) == 0 or measured.time[-1] - measured.time[0] < LEAST_DURATION:
        duration = measured.time[-1] - measured.time[0] if len(steps) else 0.0
        raise RecordingError(
            f"{duration:.3g} s are too short to identify from: record {LEAST_DURATION:g} s or more"
        )
    if (steps <= 0.0).any():
        row = int(np.argmax(steps <= 0.0)) + 1
        raise RecordingError(f"the time of row {row} is not after the row before it")
    if (fastest := 0.5 / float(np.median(steps))) <= 2.0 * cutoff:
        raise RecordingError(
            f"{2.0 * fastest:.3g} messages per second are too few for a cut-off of {cutoff:g} Hz: record more"
            f" than {4.0 * cutoff:g}, or lower --cutoff"
        )
