"""CVode of SUNDIALS, through FMPy, for the equations of an FMU for model exchange."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from schemas.errors import ScenarioError, SessionError

if TYPE_CHECKING:
    from fmpy.sundials import CVodeSolver

__all__ = ["DiscardedError", "Equations", "Integrator"]

_MOST_STEPS = 100_000
"""Internal steps of CVode between two communication points."""
_UNRECOVERABLE, _RECOVERABLE = -1, 1
"""What a right-hand side returns to CVode after an error (CVODE user guide, CVRhsFn)."""


class DiscardedError(SessionError):
    """The FMU refuses the values of a trial: a shorter step may do."""


class Equations(NamedTuple):
    """The functions of an FMU: each takes a pointer to doubles, and their number.

    They raise SessionError where the FMU fails.
    """

    states: int
    indicators: int
    get_states: Callable[[Any, int], None]
    set_states: Callable[[Any, int], None]
    get_derivatives: Callable[[Any, int], None]
    get_indicators: Callable[[Any, int], None]
    get_nominals: Callable[[Any, int], None]
    set_time: Callable[[float], None]


class Integrator:
    """Brings the states of an FMU forward in time, up to the next zero of an event indicator."""

    def __init__(self, equations: Equations, tolerance: float) -> None:
        """Begin at time 0; `tolerance` is relative, absolute tolerances follow from nominal values.

        Raises ScenarioError where FMPy has no CVode for this platform.
        """
        self._failure: SessionError | None = None
        self._solver = self._make(equations, tolerance)

    def reset(self, now: float) -> None:
        """Begin anew at `now` (s) with the states of the FMU."""
        self._solver.reset(now)

    def advance(self, now: float, target: float) -> tuple[bool, float]:
        """Integrate from `now` towards `target` (s); return whether an event stops it, and the time.

        Raises SessionError for a failure of the FMU or of CVode.
        """
        self._failure = None
        try:
            is_event, _, reached = self._solver.step(now, target)
        except (RuntimeError, TypeError) as error:  # FMPy formats an error of CVode that may have no text
            if self._failure is not None:
                raise self._failure from error
            raise SessionError(f"CVode cannot integrate the FMU from {now:.9g} s on: {error}") from error
        if self._failure is not None:
            raise self._failure
        return is_event, reached

    def _make(self, equations: Equations, tolerance: float) -> CVodeSolver:
        try:
            from fmpy.sundials import CVodeSolver
        except (ImportError, OSError) as error:
            raise ScenarioError(f"FMPy has no CVode for this platform: {error}") from error
        outer = self

        class Solver(CVodeSolver):
            """CVode whose callbacks pass failures on: an exception would be lost in C."""

            def f(self, t: float, y: Any, ydot: Any, user_data: Any) -> int:
                return outer._guarded(super().f, t, y, ydot, user_data)

            def g(self, t: float, y: Any, gout: Any, user_data: Any) -> int:
                return outer._guarded(super().g, t, y, gout, user_data)

        return Solver(
            equations.states,
            equations.indicators,
            equations.get_states,
            equations.set_states,
            equations.get_derivatives,
            equations.get_indicators,
            equations.get_nominals,
            equations.set_time,
            input=_HeldInputs(),
            startTime=0.0,
            relativeTolerance=tolerance,
            maxNumSteps=_MOST_STEPS,
        )

    def _guarded(self, function: Callable[..., int], *arguments: Any) -> int:
        try:
            return function(*arguments)
        except DiscardedError:
            return _RECOVERABLE
        except SessionError as error:
            self._failure = self._failure or error
            return _UNRECOVERABLE


class _HeldInputs:
    """Inputs between two communication points, for FMPy: they are set before."""

    def apply(self, time: float) -> None:
        """Do nothing."""
