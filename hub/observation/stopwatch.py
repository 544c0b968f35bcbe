"""Divides the time of a thread into phases, by timing methods of the objects in use."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter_ns, thread_time_ns
from types import MethodType
from typing import Any

__all__ = ["Phase", "Stopwatch"]

_SAMPLED_ROUNDS = 7
"""Rounds per reading of the thread's processor clock.

A reading is a call into the kernel, 0.3 to 5 us. Arms publish every 5 or 10 steps, devices are met every 4: a
sample every seven rounds meets all of these alike.
"""
_FIRST_SAMPLED = 3
"""The first round is unlike all others: much is done for the first time."""


class Phase:
    """A part of a thread's work, and the time spent."""

    __slots__ = ("marked_ns", "name", "sampled_ns", "taker", "wall_ns")

    def __init__(self, name: str, taker: str) -> None:
        self.name, self.taker = name, taker
        self.reset()

    def reset(self) -> None:
        """Forget the times."""
        self.wall_ns = self.marked_ns = 0
        self.sampled_ns = 0
        """Time of a core in the sampled rounds."""


class Stopwatch:
    """The phases of a thread; every moment belongs to one phase.

    A timed method is replaced on its object: an object without timing has no cost.

    Args:
        between: The phase of the time outside of timed methods.
    """

    def __init__(self, between: Phase) -> None:
        self.phases: dict[str, Phase] = {between.name: between}
        self._now = between
        self._since_ns = perf_counter_ns()
        self._core_ns = thread_time_ns()
        self._rounds, self._sampling = 0, False

    def phase(self, name: str, taker: str) -> Phase:
        """Return the phase `name` of `taker`."""
        return self.phases.setdefault(name, Phase(name, taker))

    def time(self, method: Callable[..., Any], phase: Phase, *, then: Phase | None = None) -> None:
        """Time a bound method: calls belong to `phase`; the time after, to `then`, by default as before."""
        self._replace_method(method, self._timing_wrapper(method, phase, then))

    def time_by_result(self, method: Callable[..., Any], phase: Phase, named: Callable[[Any], Phase]) -> None:
        """Time a bound method like `time`, with a phase chosen by the result of the call.

        Timed methods called inside have phases of their own.
        """

        def call_and_name(*arguments: Any) -> Any:
            result = method(*arguments)
            ended = named(result)
            if self._now is phase:
                self._now = ended
            return result

        self._replace_method(method, self._timing_wrapper(call_and_name, phase, None))

    def time_returned(self, method: Callable[..., Callable[..., Any] | None], phase: Phase) -> None:
        """Time the functions returned by a bound method: their calls belong to `phase`."""

        def call_and_wrap(*arguments: Any) -> Callable[..., Any] | None:
            call = method(*arguments)
            return None if call is None else self._timing_wrapper(call, phase, None)

        self._replace_method(method, call_and_wrap)

    def _timing_wrapper(
        self, method: Callable[..., Any], phase: Phase, then: Phase | None
    ) -> Callable[..., Any]:
        def call_timed(*arguments: Any) -> Any:
            outer = self._now
            self._count(outer)
            self._now = phase
            try:
                return method(*arguments)
            finally:
                self._count(self._now)
                self._now = then or outer

        return call_timed

    @staticmethod
    def _replace_method(method: Callable[..., Any], timed: Callable[..., Any]) -> None:
        if not isinstance(method, MethodType):
            raise TypeError(f"{method!r} is not a method of an object")
        setattr(method.__self__, method.__name__, timed)

    def _count(self, phase: Phase) -> None:
        now_ns = perf_counter_ns()
        passed_ns = now_ns - self._since_ns
        self._since_ns = now_ns
        phase.wall_ns += passed_ns
        if self._sampling:
            core_ns = thread_time_ns()
            phase.sampled_ns += core_ns - self._core_ns
            self._core_ns = core_ns

    def next_round(self) -> None:
        """Begin another round, such as a step."""
        self._count(self._now)
        self._rounds += 1
        self._sampling = self._rounds % _SAMPLED_ROUNDS == _FIRST_SAMPLED
        if self._sampling:
            self._core_ns = thread_time_ns()
        for phase in self.phases.values():
            phase.marked_ns = phase.wall_ns

    def round_ns(self) -> dict[Phase, int]:
        """Return the wall time of each phase in this round."""
        return {phase: phase.wall_ns - phase.marked_ns for phase in self.phases.values()}

    def restart(self) -> None:
        """Forget all times, and time the calling thread."""
        for phase in self.phases.values():
            phase.reset()
        self._since_ns, self._core_ns = perf_counter_ns(), thread_time_ns()
        self._rounds, self._sampling = 0, False
