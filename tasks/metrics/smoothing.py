"""Velocity and jerk of sampled positions, by least squares.

A cubic is fitted to the positions of the last 0.2 s; the derivatives in the middle are velocity and jerk
there (Savitzky and Golay, "Smoothing and differentiation of data by simplified least squares procedures",
Analytical Chemistry 36 (1964)). Differences of neighbouring samples are no alternative: at 10 ms, 1 um of
noise is 4 m/s^3 of jerk by differences, and 0.01 m/s^3 here.
"""

from __future__ import annotations

import numpy as np

from hub.participant import Record, array, integer
from schemas.vectors import Vector
from tasks.instant import Instant

__all__ = ["Smoothing", "kernels"]

_WINDOW = 0.2
"""Window of the fit, s; the movements of hands and of led arms have little above 5 Hz."""
_FEWEST = 5


def kernels(count: int, period: float) -> Vector:
    """Return the weights, (2, count), of samples, the oldest first, for velocity and jerk in the middle.

    The samples are `period` (s) apart, `count` is odd.
    """
    t = (np.arange(count) - count // 2) * period
    fit = np.linalg.pinv(np.vander(t, 4, increasing=True))
    return np.stack([fit[1], 6.0 * fit[3]])


class SmoothingState(Record):
    """The last positions."""

    positions = array("samples", "arms", 3)
    """m, the oldest first."""
    count = integer()


class Smoothing:
    """Finds velocity and jerk of the tips, half a window ago."""

    def __init__(self, arms: int, period: float) -> None:
        """`arms`: number of tips; `period`: time between positions, s."""
        count = max(_FEWEST, round(_WINDOW / period) | 1)
        self._kernels, self._count = kernels(count, period), count
        self.state = SmoothingState(samples=count, arms=arms)

    def update(self, now: Instant) -> None:
        """Write velocities, jerks and speeds into `now`."""
        state, positions = self.state, self.state.positions
        positions[:-1] = positions[1:]
        positions[-1] = now.tips
        state.count = min(state.count + 1, self._count)
        now.is_smooth = state.count == self._count
        if now.is_smooth:
            # from the newest position, as far away ones would cost digits
            found = self._kernels @ (positions - positions[-1]).reshape(self._count, -1)
            now.velocities[:], now.jerks[:] = found.reshape(2, -1, 3)
            now.speeds = np.linalg.norm(now.velocities, axis=1).tolist()
