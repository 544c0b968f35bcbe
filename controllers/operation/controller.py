"""The routine of the whole operation as a participant: the routines of its phases, one after the other."""

from __future__ import annotations

from enum import IntEnum
from typing import Any, ClassVar

import numpy as np

from controllers.cholecystectomy.approach import withdraw
from controllers.cholecystectomy.controller import ClipAndCut
from controllers.dissection.controller import Dissection
from controllers.operation.params import OperationParams
from controllers.operation.ports import PHASES, PROGRESS, operation_ports
from hub.participant import (
    Controller,
    Inputs,
    Outputs,
    Params,
    Record,
    Setup,
    array,
    choice,
    flag,
    integer,
    join_saved,
    number,
    split_saved,
    state_hash,
)
from robots.dvrk.tool_type import tool_type
from schemas.message import Message
from schemas.ports import Port
from schemas.ros import StringMessage
from schemas.trocar_msgs import TissueEvent

__all__ = ["Operation"]

_OPENING, _AWAY, _GENTLE = 0.5, 25.0e-3, 0.3
"""Time for the jaw to open (s), straight way back from the gallbladder (m), share of the speed there."""

_INSTRUMENTS = 0, 1, 0
"""Instrument of the hook's arm in each phase: the hook, or the clip applier."""


class Stage(IntEnum):
    """What happens within a phase."""

    WORK = 0
    OPEN = 1
    """The grasper lets go."""
    BACK = 2
    HOME = 3
    """The grasper goes to where it rested."""
    EXCHANGE = 4


class OperationState(Record):
    """State of the sequence."""

    phase = integer()
    stage = choice(Stage.EXCHANGE)
    begun = flag()
    """Whether the routine of the phase has had its first step."""
    elapsed = number()
    """Time in the stage, s."""
    rest = array(7)
    """Pose of the grasper before anything was touched."""
    recoveries = integer()
    """Count of recoveries in phases that are over."""
    asked = flag()
    """Whether the instrument has been asked for."""
    done = flag()
    failed = flag()
    total = integer()
    """Recoveries of all phases so far."""


class Operation(Controller):
    """Clears the triangle, clips and cuts both tubes, and frees the gallbladder."""

    params_model: ClassVar[type[Params]] = OperationParams
    params: OperationParams

    def __init__(self, name: str, params: OperationParams) -> None:
        super().__init__(name, params)
        self._parts = (
            Dissection(name, params.triangle),
            ClipAndCut(name, params.clips),
            Dissection(name, params.bed),
        )
        self.state = OperationState()
        self.keep(self.state)
        self._said: list[str] = []
        self._failure = ""

    @property
    def ports(self) -> tuple[Port, ...]:
        """The ports of all routines, once each, with the clip applier's own; the exchange; progress."""
        return operation_ports(self.params, self._parts)

    @property
    def ended(self) -> str:
        """Reason to end the session: all phases are over, or a routine has given up."""
        if not self.params.end:
            return ""
        if self.state.done:
            return f"the gallbladder is out of its bed, after {self.state.total} recoveries"
        return self._failure if self.state.failed else ""

    def configure(self, setup: Setup) -> Outputs:
        """Start with resting hands."""
        for part in self._parts:
            part.configure(setup)
        out = [port for port in self.ports if port.causality == "output"]
        self._idle: dict[str, Any] = {
            port.name: () if port.variability == "event" else np.zeros(1) for port in out
        }
        self._idle |= {name: self.state.part(name) for name in PROGRESS}
        return dict(self._idle)

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Advance the routine of the phase, or what lies between two of them."""
        state, outputs = self.state, dict(self._idle)
        if state.done or state.failed:
            return outputs
        if state.stage is Stage.WORK:
            self._work(h, inputs, outputs)
        elif state.stage is Stage.EXCHANGE:
            outputs |= self._exchange(inputs)
        else:
            outputs |= self._let_go(inputs)
        if self._said:
            outputs["status"] = (*outputs["status"], *(StringMessage(data=text) for text in self._said))
            self._said.clear()
        state.elapsed += 1e-9 * h
        return outputs

    @property
    def _part(self) -> Dissection | ClipAndCut:
        return self._parts[self.state.phase]

    def _enter(self, stage: Stage) -> None:
        self.state.stage, self.state.elapsed = stage, 0.0

    def _work(self, h: int, inputs: Inputs, outputs: dict[str, Any]) -> None:
        state, part = self.state, self._part
        given = part.step(int(state.begun), h, self._translated(inputs))
        state.begun = True
        outputs |= {name: value for name, value in given.items() if name in outputs and name not in PROGRESS}
        state.total = state.recoveries + part.state.recoveries
        if part.state.failed:
            state.failed, self._failure = True, part.ended
        elif part.state.done:
            state.recoveries = state.total
            self._said.append(f"{PHASES[state.phase]}: done")
            if state.phase == len(self._parts) - 1:
                state.done = True
            else:
                part.grasper.stay()
                part.grasper.move_jaw(part.grasper.jaw.upper - 0.02)
                self._enter(Stage.OPEN)

    def _let_go(self, inputs: Inputs) -> Outputs:
        """Open the grasper, draw back, and go to where it rested."""
        state, hand = self.state, self._part.grasper
        self._part.sense(inputs)
        if state.stage is Stage.OPEN:
            if state.elapsed > _OPENING:
                hand.go(withdraw(hand.line(), _AWAY), _GENTLE)
                self._enter(Stage.BACK)
        elif hand.has_arrived:
            if state.stage is Stage.BACK:
                hand.go(state.rest)
                self._enter(Stage.HOME)
            else:
                state.phase, state.begun, state.asked = state.phase + 1, False, False
                self._enter(Stage.EXCHANGE)
        return {
            f"{hand.arm}/servo_cp": (hand.advance(settle=False),),
            f"{hand.arm}/jaw/move_jp": hand.jaw_commands(),
        }

    def _exchange(self, inputs: Inputs) -> Outputs:
        """Ask for the instrument of the phase, and wait for the arm to have it."""
        state, arm = self.state, self.params.hook
        wanted = _INSTRUMENTS[state.phase]
        if inputs[f"{arm}/instrument"][0] == wanted:
            if state.phase == 0:
                self._part.sense(inputs)
                state.rest[:] = self._part.grasper.measured
            self._said.append(f"{PHASES[state.phase]}: begins")
            self._enter(Stage.WORK)
            return {}
        if state.asked:
            return {}
        state.asked = True
        tool = self.params.variants[wanted].tool
        return {f"{arm}/set_tool_type": (StringMessage(data=tool_type(tool)),)}

    def _translated(self, inputs: Inputs) -> Inputs:
        """Return the inputs of a routine, in which the clip applier has the name of its arm."""
        part, values = self._part, inputs.containers[0]
        events: dict[str, tuple[Message, ...]] = {}
        for port in part.ports:
            if port.causality == "input" and port.variability == "event":
                found = inputs.events(port.name)
                events[port.name] = tuple(self._renamed(message) for message in found)
        return Inputs(values, events=events)

    def _renamed(self, message: Message) -> Message:
        if isinstance(message, TissueEvent) and message.instrument == self.params.applier:
            return message.model_copy(update={"instrument": self.params.hook})
        return message

    def state_hash(self) -> int:
        """Return the hash of the whole state."""
        return state_hash(super().save(), *(part.save() for part in self._parts))

    def save(self) -> bytes:
        """Return the bytes of the whole state."""
        return join_saved(super().save(), *(part.save() for part in self._parts))

    def restore(self, state: bytes) -> None:
        """Return to a saved state. Raises StateError if the state does not fit."""
        own, *others = split_saved(self.name, 1 + len(self._parts), state)
        super().restore(own)
        for part, saved in zip(self._parts, others, strict=True):
            part.restore(saved)
