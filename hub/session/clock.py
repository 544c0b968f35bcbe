"""The clock: horizon and earliest time of each grant."""

from __future__ import annotations

import logging
from time import monotonic_ns, sleep

from hub.planning.plan import Plan

__all__ = ["Clock", "most_steps"]

log = logging.getLogger(__name__)

_WINDOW_NS = 10_000_000
"""Simulated time of a grant where nothing enters and the scenario sets no window.

Requests to the hub then take effect at 100 Hz of simulated time, and a step of 1 ms bears a tenth of the cost
of a grant.
"""

_CAUGHT_UP_NS = 50_000_000
"""How late a step may be before simulated time slips (docs/decisions/0034).

Two pictures of the endoscope drawn without a GPU take 22 ms.
"""
_OBSERVED_NS = 5_000_000_000
"""Wall time over which the speed of simulated time is judged."""
_REPORT_NS = 60_000_000_000
"""Wall time between two reports of slow simulated time."""
_SLOW = 0.8
"""Share of real time. The limits of an arm hold in simulated time: at 0.18, a PSM led by a ROS program at
0.1 m/s was up to 50 mm behind.
"""


class Clock:
    """The simulated time of a run, and the horizon of each grant, in steps.

    Pace `fast` never waits; `realtime` follows the wall clock and counts late steps. By default a grant is
    a single step in real time, where every step waits for the wall clock, and with several hosts, where the
    end of a process inside a grant would stay unnoticed until the horizon of the grant.

    Args:
        plan: The plan of the session.
        window: The most steps of a grant; None: as many as are of use.
        realtime: Follow the wall clock.
        steps: The number of steps of the whole run; None: until stopped.
        live_from: The steps before this one do not follow the wall clock.
    """

    def __init__(
        self, plan: Plan, *, window: int | None, realtime: bool, steps: int | None, live_from: int = 0
    ) -> None:
        self.step_ns = plan.step_ns
        self.step = 0
        self.late_steps = 0
        alone = not realtime and len(plan.hosts()) == 1
        self._window = most_steps(plan, window) if window or alone else 1
        self.realtime = realtime and not live_from
        """Whether steps follow the wall clock."""
        self._paced = realtime
        self.steps = steps
        self._periods = plan.grant_stop_periods()
        self._follows = bool(plan.from_devices)
        self._wall_zero_ns = self._observed_from_ns = monotonic_ns()
        self._slipped_ns = self._next_report_ns = 0

    @property
    def time_ns(self) -> int:
        """Simulated time of the present communication point."""
        return self.step * self.step_ns

    @property
    def done(self) -> bool:
        """Whether all steps of the run are done."""
        return self.steps is not None and self.step >= self.steps

    def horizon(self, most: int | None = None) -> int:
        """Return how many steps the next grant covers."""
        count = self._window if most is None else min(self._window, most)
        if self.steps is not None:
            count = min(count, self.steps - self.step)
        for period in self._periods:
            count = min(count, period - self.step % period)
        return count

    def go_live(self) -> None:
        """Follow the wall clock from now on, if the session does."""
        self.realtime = self._paced
        self.start()

    def start(self) -> None:
        """Let wall time run from now, at the start and after a pause."""
        self._observe_from(monotonic_ns())
        self._wall_zero_ns = self._observed_from_ns - self.time_ns

    def advance(self, count: int) -> None:
        """Advance by `count` steps; in real time wait for the wall clock.

        Later steps catch up a delay, up to a limit; beyond the limit simulated time slips.
        """
        self.step += count
        if not self.realtime:
            return
        now_ns = monotonic_ns()
        ahead_ns = self._wall_zero_ns + self.time_ns - now_ns
        if ahead_ns >= 0:
            sleep(ahead_ns / 1e9)
        else:
            self.late_steps += count
            self._slip_time(max(-ahead_ns - _CAUGHT_UP_NS, 0), now_ns)

    def _slip_time(self, slip_ns: int, now_ns: int) -> None:
        """Let simulated time slip; report the slip where devices lead."""
        self._wall_zero_ns += slip_ns
        self._slipped_ns += slip_ns
        observed_ns = now_ns - self._observed_from_ns
        if observed_ns < _OBSERVED_NS:
            return
        factor = 1.0 - self._slipped_ns / observed_ns
        if factor < _SLOW and self._follows and now_ns >= self._next_report_ns:
            self._next_report_ns = now_ns + _REPORT_NS
            log.warning(
                "simulated time runs at %.2f of real time: what devices and ROS programs lead follows them"
                " late (docs/how-to/real-time.md)",
                factor,
            )
        self._observe_from(now_ns)

    def _observe_from(self, now_ns: int) -> None:
        self._observed_from_ns, self._slipped_ns = now_ns, 0


def most_steps(plan: Plan, window: int | None) -> int:
    """Return the most steps of a grant of a session; `window` is the scenario's."""
    return window or max(1, _WINDOW_NS // plan.step_ns)
