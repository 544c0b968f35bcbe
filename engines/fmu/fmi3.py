"""FMI 3.0 co-simulation, with events."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from engines.fmu.blocks import WARNING, Block
from engines.fmu.clock import Clock
from engines.fmu.description import Description
from engines.fmu.instance import GOES_ON, Instance
from engines.fmu.log import log_everything, log_message
from engines.fmu.start import Start
from engines.fmu.texts import Text
from engines.fmu.ticks import Ticks
from engines.fmu.transfers import Transfers, compiled
from hub.participant import Inputs
from schemas.errors import SessionError
from schemas.ros import EmptyMessage

if TYPE_CHECKING:
    from fmpy.model_description import CoSimulation

__all__ = ["Fmi3Instance", "co_simulation_notes"]

_SAME_INSTANT_S = 0.5e-9
"""Simulated time has whole nanoseconds: times nearer than half a nanosecond are the same instant."""
_MOST_EVENTS = 10_000
"""Most events in a step. An FMU with more events stands still (a Zeno point), and a session must not hang."""


def co_simulation_notes(interface: CoSimulation) -> str:
    """Return what is used of an FMU's event mode, early return and intermediate update, for the plan."""
    notes: list[str] = []
    if interface.hasEventMode:
        notes.append("events at their time, inside a step")
    elif interface.mightReturnEarlyFromDoStep:
        notes.append("a step that returns early goes on to its end")
    if interface.providesIntermediateUpdate:
        notes.append("intermediate update is not used: values are exchanged at the ends of steps")
    return f"FMI 3.0 co-simulation: {'; '.join(notes)}" if notes else ""


class Fmi3Instance(Instance):
    """An FMI 3.0 FMU.

    With an event mode, events are handled at their time, inside the step.
    """

    prefix = "fmi3"
    counted = True
    state_word = "FMUState"
    deserialise_word = "Deserialize"
    byte = ctypes.c_uint8
    required = (
        "InstantiateCoSimulation",
        "EnterInitializationMode",
        "ExitInitializationMode",
        "DoStep",
        "FreeInstance",
    )

    def __init__(self, description: Description, name: str) -> None:
        """Load and instantiate the FMU."""
        from fmpy.fmi3 import FMU3Slave

        capabilities = description.co_simulation
        assert capabilities is not None

        def log(environment: int | None, status: int, category: bytes, message: bytes) -> None:  # noqa: ARG001
            log_message(name, status, category, message)

        # some FMUs declare an event mode that their library does not have (Roberts of the Reference FMUs)
        modes = [True, False] if capabilities.hasEventMode else [False]
        common = {"earlyReturnAllowed": True, "logMessage": log, "loggingOn": log_everything()}
        super().__init__(FMU3Slave, description, name, [common | {"eventModeUsed": used} for used in modes])
        self._has_events = bool(self.options["eventModeUsed"])
        self._splits = self._has_events and capabilities.canHandleVariableCommunicationStepSize
        if description.clocks and not self._has_events:
            raise SessionError("the FMU has clocks and refuses its event mode, in which they tick")
        self._ticks = Ticks(self, description.clocks)
        free = [block for block in self.inputs if not block.clocks]
        self._event_blocks = [block for block in free if block.discrete and self._has_events]
        self._set_blocks = Transfers(self, [block for block in free if block not in self._event_blocks])
        self._clocked_blocks = [block for block in self.inputs if block.clocks]
        # time of the next event, discrete inputs, and the state of the clocks
        self._events_end = 1 + sum(block.values.size for block in self._event_blocks)
        self.memory = np.full(self._events_end + self._ticks.size, math.inf)
        self._ticks.bind(self.memory[self._events_end :])
        self._needs_event = False
        self._again, self._terminate, self._nominals, self._states, self._scheduled = (
            ctypes.c_bool() for _ in range(5)
        )
        self._next = ctypes.c_double()
        self._do_step = self._prepare_step()
        self._update_results = [
            ctypes.byref(x)
            for x in (self._again, self._terminate, self._nominals, self._states, self._scheduled, self._next)
        ]

    def _prepare_step(self) -> Callable[[float, float], tuple[int, int, int, int, float]]:
        """Return a call of `fmi3DoStep`: time and size (s).

        The call returns status, eventHandlingNeeded, terminateSimulation, earlyReturn, lastSuccessfulTime.
        """
        if compiled is not None:
            return partial(compiled.step3, self.address("DoStep"), self.component)
        function = self._function("DoStep")
        flags, reached = [ctypes.c_bool() for _ in range(3)], ctypes.c_double()
        results = [ctypes.byref(one) for one in (*flags, reached)]

        def call(now: float, size: float) -> tuple[int, int, int, int, float]:
            status = function(self.component, now, size, GOES_ON, *results)
            event, ends, early = (flag.value for flag in flags)
            return status, event, ends, early, reached.value

        return call

    def _initialise(self, starts: Sequence[Start], tolerance: float | None) -> None:
        self._set_structure(starts)
        for start in starts:
            if not start.structural:
                self._set_start(start)
        self.call("EnterInitializationMode", tolerance is not None, tolerance or 0.0, 0.0, False, 0.0)
        self.call("ExitInitializationMode")
        if self._has_events:
            self._ticks.start()
            if not self._update_discrete_states(self._ticks.due(_SAME_INSTANT_S), at=0.0):
                raise SessionError(f"the FMU asks to end the simulation before it begins{self._reason()}")
            self.call("EnterStepMode")

    def set_inputs(self, inputs: Inputs, tau: float, dt: float) -> None:
        """Set continuous inputs to their mean over `dt` seconds, changed discrete inputs in event mode."""
        self._set_blocks.set(inputs, tau + dt / 2)
        for block in (*self._event_blocks, *self._clocked_blocks):
            block.store(inputs, tau)
        texts = self.text_inputs.changed(inputs)
        if texts and not self._has_events:
            self.set_texts(texts)
        elif self._take_discrete() or texts:
            self._handle_event(self._event_blocks, texts=texts, at=self.now_ns / 1e9)
        for port, clock in self._ticks.triggered.items() if tau == 0.0 else ():
            for _ in inputs.events(port):
                if not self.ended:
                    self._handle_event(clocks=[clock], at=self.now_ns / 1e9)

    def _take_discrete(self) -> bool:
        """Keep the discrete inputs, and return whether one has changed."""
        if not self._event_blocks:
            return False
        values = np.concatenate([block.values for block in self._event_blocks])
        if np.array_equal(values, self.memory[1 : self._events_end]):
            return False
        self.memory[1 : self._events_end] = values
        return True

    def recall(self) -> None:
        """Take over `memory`, after a return to a saved state."""
        super().recall()
        self._ticks.recall()

    def take_ticks(self) -> Mapping[str, tuple[EmptyMessage, ...]]:
        """Return the ticks of output clocks since the last call, by port."""
        return self._ticks.take_found()

    def tune(self, blocks: Sequence[Block]) -> None:
        """Set tunable parameters between two steps; in event mode, if the FMU has one."""
        if self._has_events:
            self._handle_event(blocks, at=self.now_ns / 1e9)
        else:
            super().tune(blocks)

    def advance(self, t: int, h: int) -> None:
        """Bring the FMU from `t` to `t + h` (ns), event by event, or to the FMU's end of the simulation."""
        now, end = t / 1e9, (t + h) / 1e9
        for _ in range(_MOST_EVENTS):
            tick = self._ticks.next_time
            target = min(end, float(self.memory[0]), tick) if self._splits else end
            if target - tick > _SAME_INSTANT_S:
                raise SessionError(
                    f"a clock of the FMU ticks at {tick:.9g} s, inside the step to {end:.9g} s, and the FMU"
                    " takes no shorter steps; choose a 'step' that divides the clock's interval"
                )
            needs_event = target - now < _SAME_INSTANT_S  # an event scheduled for this instant
            if not needs_event:
                now = self._step_to(now, target)
                scheduled = min(self.memory[0], tick)
                needs_event = self._has_events and (self._needs_event or now > scheduled - _SAME_INSTANT_S)
            if needs_event and not self.ended:
                self._handle_event(clocks=self._ticks.due(now + _SAME_INSTANT_S), at=now)
            if self.ended or end - now < _SAME_INSTANT_S:
                return
        raise SessionError(
            f"the FMU reached only {now:.9g} s in {_MOST_EVENTS} events of the step to {end:.9g} s"
        )

    def _step_to(self, now: float, target: float) -> float:
        """Step towards `target` and return the reached time."""
        status, event, ends, early, reached = self._do_step(now, target - now)
        if status > WARNING:
            raise self.failure("DoStep", status, f" for the step from {now:.9g} s to {target:.9g} s")
        self._needs_event = bool(event)
        reached = reached if early else target
        if ends:
            self._end(reached, "terminateSimulation of fmi3DoStep")
        return reached

    def _handle_event(
        self,
        inputs: Sequence[Block] = (),
        *,
        texts: Sequence[tuple[Text, bytes]] = (),
        clocks: Sequence[Clock] = (),
        at: float,
    ) -> None:
        """Handle the event at `at` (s). An FMU at the end of its simulation stays in event mode."""
        self.call("EnterEventMode")
        for block in inputs:
            self.transfer(block)
        self.set_texts(texts)
        if self._update_discrete_states(clocks, at=at):
            self.call("EnterStepMode")
        else:
            self._end(at, "terminateSimulation of fmi3UpdateDiscreteStates")

    def _update_discrete_states(self, clocks: Sequence[Clock], *, at: float) -> bool:
        """Iterate the event until the discrete states stay, and note the time of the next event.

        `clocks` tick in the first iteration. Returns whether the simulation goes on: the FMU may ask for the
        end.
        """
        self._ticks.tick(clocks)
        for _ in range(_MOST_EVENTS):
            self._ticks.collect(clocks)
            self._ticks.schedule(clocks)
            self.call("UpdateDiscreteStates", *self._update_results)
            self._ticks.count_down(at)
            if self._terminate.value:
                return False
            if not self._again.value:
                self.memory[0] = self._next.value if self._scheduled.value else math.inf
                return True
            clocks = self._ticks.due(at + _SAME_INSTANT_S)
            self._ticks.tick(clocks)
        raise SessionError(
            f"the discrete states of the FMU do not settle in {_MOST_EVENTS} iterations of one event"
        )
