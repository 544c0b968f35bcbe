"""Ticks of the clocks of an FMI 3.0 FMU: when they are due, and the variables that they clock."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from engines.fmu.clock import Clock
from schemas.errors import SessionError
from schemas.ros import EmptyMessage
from schemas.vectors import Vector

if TYPE_CHECKING:
    from engines.fmu.instance import Instance

__all__ = ["Ticks"]

_CHANGED = 2
"""fmi3IntervalQualifier: intervalChanged."""
_COUNTDOWN, _CHANGING = "countdown", "changing"


class Ticks:
    """Lets clocks tick in event mode.

    A clocked variable exists at the ticks of its clocks alone (FMI 3.0.2, section 2.2.8.3): an input is set,
    an output is got then, and the output holds its value in between.
    """

    def __init__(self, instance: Instance, clocks: Sequence[Clock]) -> None:
        """Find the clocks of `instance`, which has its blocks of inputs and outputs."""
        self._instance = instance
        self._timed = [clock for clock in clocks if clock.is_timed]
        self._triggered = {one.port: one for one in clocks if one.is_input and not one.is_timed}
        self._emitting = [clock for clock in clocks if not clock.is_input]
        self._inputs = [block for block in instance.inputs if block.clocks]
        self._outputs = [block for block in instance.outputs if block.clocks]
        self.size = len(self._timed) + sum(block.values.size for block in self._outputs)
        """Size of the state: times of the next ticks, then the held outputs."""
        self.bind(np.zeros(self.size))
        self._found: dict[str, list[EmptyMessage]] = {clock.port: [] for clock in self._emitting}

    def bind(self, memory: Vector) -> None:
        """Keep the state in `memory`, shape (size,)."""
        self._next, self._held = np.split(memory, [len(self._timed)])

    @property
    def next_time(self) -> float:
        """Time of the next tick, s; infinite for none."""
        return float(self._next.min(initial=math.inf))

    @property
    def triggered(self) -> Mapping[str, Clock]:
        """Triggered input clocks by port."""
        return self._triggered

    def start(self) -> None:
        """Find the first ticks, in the event mode at the start."""
        for i, clock in enumerate(self._timed):
            self._next[i] = math.inf if clock.kind == _COUNTDOWN else clock.shift
        self._keep_outputs()
        self.count_down(0.0)

    def due(self, until: float) -> list[Clock]:
        """Return the clocks that tick until `until` (s)."""
        return [clock for clock, at in zip(self._timed, self._next.tolist(), strict=True) if at <= until]

    def tick(self, clocks: Sequence[Clock]) -> None:
        """Let input clocks tick: activate them, and set the inputs that they clock."""
        if not clocks:
            return
        count, active = len(clocks), {clock.reference for clock in clocks}
        references = (ctypes.c_uint * count)(*active)
        self._instance.call("SetClock", references, count, (ctypes.c_bool * count)(*[True] * count))
        for block in self._inputs:
            if active & set(block.clocks):
                self._instance.transfer(block)

    def collect(self, clocks: Sequence[Clock]) -> None:
        """Take the ticks of output clocks and the clocked outputs, before the discrete states are updated."""
        active = {clock.reference for clock in clocks}
        if count := len(self._emitting):
            references = (ctypes.c_uint * count)(*(clock.reference for clock in self._emitting))
            ticked = (ctypes.c_bool * count)()
            self._instance.call("GetClock", references, count, ticked)
            for clock, has_ticked in zip(self._emitting, ticked, strict=True):
                if has_ticked:
                    self._found[clock.port].append(EmptyMessage())
                    active.add(clock.reference)
        for block in self._outputs:
            if active & set(block.clocks):
                self._instance.transfer(block)
                block.publish()
        self._keep_outputs()

    def schedule(self, clocks: Sequence[Clock]) -> None:
        """Find the next ticks of clocks that tick now, before the discrete states are updated."""
        for i, clock in enumerate(self._timed):
            if clock not in clocks:
                continue
            if clock.kind == _COUNTDOWN:
                self._next[i] = math.inf
                continue
            interval = clock.interval
            if interval is None or clock.kind == _CHANGING:
                interval, _ = self._interval(clock)
                self._next[i] += interval
            else:
                ticks = round((self._next[i] - clock.shift) / interval) + 1
                self._next[i] = clock.shift + ticks * interval

    def count_down(self, now: float) -> None:
        """Start the countdowns that the FMU has asked for, after its discrete states were updated."""
        for i, clock in enumerate(self._timed):
            if clock.kind == _COUNTDOWN:
                interval, qualifier = self._interval(clock)
                if qualifier == _CHANGED:
                    self._next[i] = now + interval

    def take_found(self) -> Mapping[str, tuple[EmptyMessage, ...]]:
        """Return the ticks of output clocks since the last call, by port."""
        found = {port: tuple(messages) for port, messages in self._found.items()}
        for messages in self._found.values():
            messages.clear()
        return found

    def recall(self) -> None:
        """Hold the outputs of the state again, after a return to a saved state."""
        at = 0
        for block in self._outputs:
            block.values[:] = self._held[at : at + block.values.size]
            at += block.values.size

    def _keep_outputs(self) -> None:
        if self._outputs:
            self._held[:] = np.concatenate([block.values for block in self._outputs])

    def _interval(self, clock: Clock) -> tuple[float, int]:
        """Return the interval of a clock, s, and FMI's qualifier."""
        interval, qualifier = ctypes.c_double(), ctypes.c_int()
        self._instance.call(
            "GetIntervalDecimal",
            (ctypes.c_uint * 1)(clock.reference),
            1,
            ctypes.byref(interval),
            ctypes.byref(qualifier),
        )
        if not 0.0 <= interval.value < math.inf or (interval.value == 0.0 and clock.kind != _COUNTDOWN):
            raise SessionError(
                f"the FMU states an interval of {interval.value:g} s for its clock '{clock.name}'"
            )
        return interval.value, qualifier.value
