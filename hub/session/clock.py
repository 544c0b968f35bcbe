"""The clock: how far each grant goes, and when it may be given."""

from __future__ import annotations

from time import monotonic_ns, sleep

from hub.planning.plan import Plan

__all__ = ["Clock"]

_WINDOW_NS = 10_000_000
"""Simulated time that a grant covers where nothing enters and the scenario does not say: what is asked of the
hub then takes effect at 100 Hz of simulated time, and turning round costs a step of 1 ms a tenth.
"""

_CAUGHT_UP_NS = 50_000_000
"""By how much a step may come late before simulated time slips (docs/decisions/0034): two pictures of the
endoscope drawn without a GPU take 22 ms.
"""


class Clock:
    """Hands out horizons in steps.

    Pace `fast` never waits; `realtime` follows the wall clock and counts what comes late.
    """

    def __init__(self, plan: Plan, *, window: int | None, realtime: bool, steps: int | None) -> None:
        """Take the most steps of a grant (None: as many as are of use), the pace, and the number of steps of
        the whole run (None: until stopped).

        A window has to be asked for in real time, where every step waits for the wall clock, and with several
        hosts, of whose steps inside a grant nothing is heard if one of them dies.
        """
        self.step_ns = plan.step_ns
        self.step = 0
        self.late_steps = 0
        alone = not realtime and len(plan.hosts()) == 1
        self._window = window or (max(1, _WINDOW_NS // plan.step_ns) if alone else 1)
        self.realtime = realtime
        """Whether steps follow the wall clock."""
        self.steps = steps
        self._periods = sorted(
            {plan.participants[inlet.target].period for inlet in plan.from_devices}
            | {device.period for device in plan.meetings()}
        )
        self._wall_zero_ns = monotonic_ns()

    @property
    def time_ns(self) -> int:
        """Simulated time of the present communication point."""
        return self.step * self.step_ns

    @property
    def done(self) -> bool:
        """Say whether the run has all its steps."""
        return self.steps is not None and self.step >= self.steps

    def horizon(self, most: int | None = None) -> int:
        """Return how many steps the next grant covers.

        No participant that listens to a device may start a step inside a grant, or it would miss the newest
        samples; and no device may be due inside it that is to be written what the others have computed.
        """
        count = self._window if most is None else min(self._window, most)
        if self.steps is not None:
            count = min(count, self.steps - self.step)
        for period in self._periods:
            count = min(count, period - self.step % period)
        return count

    def start(self) -> None:
        """Let wall time run from here, at the beginning and after a pause."""
        self._wall_zero_ns = monotonic_ns() - self.time_ns

    def advance(self, count: int) -> None:
        """Go on by `count` steps; in real time wait for the wall clock.

        What comes late is caught up by the next steps; what is too late for that slips.
        """
        self.step += count
        if not self.realtime:
            return
        ahead_ns = self._wall_zero_ns + self.time_ns - monotonic_ns()
        if ahead_ns >= 0:
            sleep(ahead_ns / 1e9)
        else:
            self.late_steps += count
            self._wall_zero_ns += max(-ahead_ns - _CAUGHT_UP_NS, 0)
