"""FMUs for model exchange: the FMU has the equations, and CVode integrates them here.

CVode begins anew at each communication point. Inputs jump there, and a saved state is then that of the FMU
alone: a solver that goes on would have a history, which no FMU state holds.
"""

from __future__ import annotations

import ctypes
import math
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from engines.fmu.blocks import WARNING, Block
from engines.fmu.cvode import DiscardedError, Equations, Integrator
from engines.fmu.description import Description
from engines.fmu.instance import DISCARD, GOES_ON, Instance
from engines.fmu.log import fmi2_callbacks, log_everything, log_message
from engines.fmu.start import Start
from engines.fmu.texts import Text
from engines.fmu.transfers import Transfers
from hub.participant import Inputs
from schemas.errors import SessionError

__all__ = ["Fmi2ModelExchange", "Fmi3ModelExchange", "default_tolerance"]

_LARGEST_DEFAULT = 1e-8
"""Relative tolerance unless one is stated.

Each new beginning is integrated by steps of low order, whose errors add up over the communication points.
"""
_SAME_INSTANT_S = 0.5e-9
"""Simulated time has whole nanoseconds."""
_MOST_EVENTS = 10_000
"""Most events in a step. An FMU with more events stands still (a Zeno point), and a session must not hang."""


def default_tolerance(suggested: float | None) -> float:
    """Return the relative tolerance where the scenario states none; `suggested`: the FMU's."""
    return min(suggested or _LARGEST_DEFAULT, _LARGEST_DEFAULT)


class ModelExchange(Instance):
    """An FMU for model exchange, in continuous-time mode between two calls."""

    boolean: ClassVar[Any]
    derivatives: ClassVar[str]
    """Name of the function that gets the derivatives."""
    update: ClassVar[str]
    """Name of the function that updates the discrete states."""

    def __init__(
        self, slave: type[Any], description: Description, name: str, options: Mapping[str, Any]
    ) -> None:
        """Load and instantiate the FMU."""
        super().__init__(slave, description, name, [options])
        self._event_blocks = [block for block in self.inputs if block.discrete]
        self._set_blocks = Transfers(self, [block for block in self.inputs if not block.discrete])
        # time of the next event, discrete inputs
        self.memory = np.full(1 + sum(block.values.size for block in self._event_blocks), math.inf)
        self._completes = description.completes_steps
        self._suggested = description.tolerance
        self._enter, self._terminate = self.boolean(), self.boolean()

    @abstractmethod
    def _begin(self, starts: Sequence[Start], tolerance: float | None) -> None:
        """Set the start values and leave the initialisation mode."""

    @abstractmethod
    def _update_once(self) -> tuple[bool, bool, float]:
        """Update the discrete states once.

        Returns whether another update is needed, whether the FMU asks for the end, and the time of the next
        event, infinite for none.
        """

    @abstractmethod
    def _sizes(self) -> tuple[int, int]:
        """Return the numbers of continuous states and of event indicators."""

    def _initialise(self, starts: Sequence[Start], tolerance: float | None) -> None:
        self._begin(starts, tolerance)
        if not self._update_discrete_states():
            raise SessionError(f"the FMU asks to end the simulation before it begins{self._reason()}")
        self.call("EnterContinuousTimeMode")
        states, indicators = self._sizes()
        equations = Equations(
            states,
            indicators,
            *map(
                self._equation,
                (
                    "GetContinuousStates",
                    "SetContinuousStates",
                    self.derivatives,
                    "GetEventIndicators",
                    "GetNominalsOfContinuousStates",
                    "SetTime",
                ),
            ),
        )
        self._integrator = Integrator(equations, tolerance or default_tolerance(self._suggested))

    def _equation(self, name: str) -> Callable[..., None]:
        """Return a function of the FMU for the solver: a discard lets the solver try a shorter step."""
        function, component = self._function(name), self.component

        def equation(*arguments: Any) -> None:
            status = function(component, *arguments)
            if status == DISCARD:
                raise DiscardedError(f"{self.prefix}{name} has discarded the values{self._reason()}")
            if status > WARNING:
                raise self.failure(name, status)

        return equation

    def set_inputs(self, inputs: Inputs, tau: float, dt: float) -> None:
        """Set continuous inputs to their mean over `dt` seconds, changed discrete inputs in event mode."""
        self._set_blocks.set(inputs, tau + dt / 2)
        texts = self.text_inputs.changed(inputs)
        if not self._event_blocks and not texts:
            return
        for block in self._event_blocks:
            block.store(inputs, tau)
        # the empty part is for an FMU with texts and no discrete numbers
        values = np.concatenate([self.memory[:0], *(block.values for block in self._event_blocks)])
        if texts or not np.array_equal(values, self.memory[1:]):
            self.memory[1:] = values
            self._handle_event(self._event_blocks, texts, at=self.now_ns / 1e9)

    def tune(self, blocks: Sequence[Block]) -> None:
        """Set tunable parameters in event mode."""
        self._handle_event(blocks, at=self.now_ns / 1e9)

    def advance(self, t: int, h: int) -> None:
        """Integrate from `t` to `t + h` (ns), event by event, or to the FMU's end of the simulation."""
        now, end = t / 1e9, (t + h) / 1e9
        self.call("SetTime", now)
        self._integrator.reset(now)
        for _ in range(_MOST_EVENTS):
            target = min(end, float(self.memory[0]))
            is_event = target - now < _SAME_INSTANT_S  # one that is scheduled for this instant
            if not is_event:
                is_event, now = self._integrate(now, target)
                is_event |= now > self.memory[0] - _SAME_INSTANT_S
            if is_event and not self.ended:
                self._handle_event(at=now)
                self._integrator.reset(now)
            if self.ended or end - now < _SAME_INSTANT_S:
                return
        raise SessionError(
            f"the FMU reached only {now:.9g} s in {_MOST_EVENTS} events of the step to {end:.9g} s"
        )

    def _integrate(self, now: float, target: float) -> tuple[bool, float]:
        """Return whether an event follows, and the reached time."""
        is_event, now = self._integrator.advance(now, target)
        self.call("SetTime", now)
        if self._completes:
            results = ctypes.byref(self._enter), ctypes.byref(self._terminate)
            self.call("CompletedIntegratorStep", GOES_ON, *results)
            is_event |= bool(self._enter.value)
            if self._terminate.value:
                self._end(now, f"terminateSimulation of {self.prefix}CompletedIntegratorStep")
        return is_event, now

    def _handle_event(
        self, inputs: Sequence[Block] = (), texts: Sequence[tuple[Text, bytes]] = (), *, at: float
    ) -> None:
        self.call("EnterEventMode")
        for block in inputs:
            self.transfer(block)
        self.set_texts(texts)
        if self._update_discrete_states():
            self.call("EnterContinuousTimeMode")
        else:
            self._end(at, f"terminateSimulation of {self.prefix}{self.update}")

    def _update_discrete_states(self) -> bool:
        """Iterate the event until the discrete states stay; return whether the simulation goes on."""
        for _ in range(_MOST_EVENTS):
            again, ends, self.memory[0] = self._update_once()
            if ends or not again:
                return not ends
        raise SessionError(
            f"the discrete states of the FMU do not settle in {_MOST_EVENTS} iterations of one event"
        )


class Fmi2ModelExchange(ModelExchange):
    """An FMI 2.0 FMU for model exchange."""

    prefix = "fmi2"
    counted = False
    state_word = "FMUstate"
    deserialise_word = "DeSerialize"
    byte = ctypes.c_char
    boolean = ctypes.c_int
    derivatives = "GetDerivatives"
    update = "NewDiscreteStates"
    required = ("Instantiate", "SetupExperiment", "SetTime", "NewDiscreteStates", "GetDerivatives")

    def __init__(self, description: Description, name: str) -> None:
        """Load and instantiate the FMU."""
        from fmpy.fmi2 import FMU2Model, fmi2EventInfo

        options = {"callbacks": fmi2_callbacks(), "loggingOn": log_everything()}
        super().__init__(FMU2Model, description, name, options)
        self._counts = description.states, description.indicators
        self._info = fmi2EventInfo()

    def _begin(self, starts: Sequence[Start], tolerance: float | None) -> None:
        self.call("SetupExperiment", tolerance is not None, tolerance or 0.0, 0.0, False, 0.0)
        for start in starts:
            self._set_start(start)
        self.call("EnterInitializationMode")
        self.call("ExitInitializationMode")

    def _update_once(self) -> tuple[bool, bool, float]:
        info = self._info
        self.call(self.update, ctypes.byref(info))
        next_time = info.nextEventTime if info.nextEventTimeDefined else math.inf
        return bool(info.newDiscreteStatesNeeded), bool(info.terminateSimulation), next_time

    def _sizes(self) -> tuple[int, int]:
        return self._counts


class Fmi3ModelExchange(ModelExchange):
    """An FMI 3.0 FMU for model exchange."""

    prefix = "fmi3"
    counted = True
    state_word = "FMUState"
    deserialise_word = "Deserialize"
    byte = ctypes.c_uint8
    boolean = ctypes.c_bool
    derivatives = "GetContinuousStateDerivatives"
    update = "UpdateDiscreteStates"
    required = (
        "InstantiateModelExchange",
        "SetTime",
        "UpdateDiscreteStates",
        "GetContinuousStateDerivatives",
    )

    def __init__(self, description: Description, name: str) -> None:
        """Load and instantiate the FMU."""
        from fmpy.fmi3 import FMU3Model

        def log(environment: int | None, status: int, category: bytes, message: bytes) -> None:  # noqa: ARG001
            log_message(name, status, category, message)

        super().__init__(FMU3Model, description, name, {"logMessage": log, "loggingOn": log_everything()})
        self._flags = [ctypes.c_bool() for _ in range(5)]
        self._next = ctypes.c_double()

    def _begin(self, starts: Sequence[Start], tolerance: float | None) -> None:
        self._set_structure(starts)
        for start in starts:
            if not start.structural:
                self._set_start(start)
        self.call("EnterInitializationMode", tolerance is not None, tolerance or 0.0, 0.0, False, 0.0)
        self.call("ExitInitializationMode")

    def _update_once(self) -> tuple[bool, bool, float]:
        self.call(self.update, *(ctypes.byref(one) for one in (*self._flags, self._next)))
        again, ends, _, _, is_scheduled = (flag.value for flag in self._flags)
        return again, ends, self._next.value if is_scheduled else math.inf

    def _sizes(self) -> tuple[int, int]:
        states, indicators = ctypes.c_size_t(), ctypes.c_size_t()
        self.call("GetNumberOfContinuousStates", ctypes.byref(states))
        self.call("GetNumberOfEventIndicators", ctypes.byref(indicators))
        return states.value, indicators.value
