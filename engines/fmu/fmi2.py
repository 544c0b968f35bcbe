"""FMI 2.0 co-simulation."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from engines.fmu.blocks import WARNING
from engines.fmu.description import Description
from engines.fmu.instance import DISCARD, GOES_ON, Instance
from engines.fmu.linear_input import LinearInput
from engines.fmu.log import fmi2_callbacks, log_everything
from engines.fmu.start import Start
from engines.fmu.transfers import Stop, Transfers
from engines.fmu.variables import Variable
from hub.participant import Inputs
from schemas.vectors import Vector

__all__ = ["Fmi2Instance"]

_LAST_SUCCESSFUL_TIME, _TERMINATED = 2, 3
"""fmi2StatusKind (fmi2FunctionTypes.h)."""
_INPUTS, _OUTPUTS = 0, 2
"""Parts of a step in `_calls.c`."""


class Fmi2Instance(Instance):
    """An FMI 2.0 FMU."""

    prefix = "fmi2"
    counted = False
    state_word = "FMUstate"
    deserialise_word = "DeSerialize"
    byte = ctypes.c_char
    required = (
        "Instantiate",
        "SetupExperiment",
        "EnterInitializationMode",
        "ExitInitializationMode",
        "DoStep",
        "FreeInstance",
    )

    def __init__(self, description: Description, name: str) -> None:
        """Load and instantiate the FMU."""
        from fmpy.fmi2 import FMU2Slave

        options = {"callbacks": fmi2_callbacks(), "loggingOn": log_everything()}
        super().__init__(FMU2Slave, description, name, [options])
        self._do_step: Callable[..., int] = self._function("DoStep")
        self._step_address = self.address("DoStep")
        self._set_blocks = Transfers(self, self.inputs)
        capabilities = description.co_simulation
        assert capabilities is not None
        self._varies = capabilities.canHandleVariableCommunicationStepSize
        self._interpolates = capabilities.canInterpolateInputs and self.library.has(
            "fmi2SetRealInputDerivatives"
        )
        continuous = [
            variable
            for variable in description.inputs
            if variable.type.name == "Real" and not variable.discrete and self._interpolates
        ]
        self._slope_ports = [variable.port for variable in continuous]
        self._slopes, self._set_slopes = self._slope_call(continuous)
        self._moved = False
        """Whether an input had a slope in the last step; the FMU begins with slopes of 0."""

    def _slope_call(self, variables: Sequence[Variable]) -> tuple[Vector, Callable[[], None]]:
        """Return the slopes of scalar inputs, shape (n,), and the call that sets them."""
        count = len(variables)
        slopes = np.zeros(count)
        call = partial(
            self._function("SetRealInputDerivatives"),
            self.component,
            (ctypes.c_uint * count)(*(variable.reference for variable in variables)),
            count,
            (ctypes.c_int * count)(*[1] * count),
            slopes.ctypes.data_as(ctypes.POINTER(ctypes.c_double)),
        )

        def set_slopes() -> None:
            status = call()
            if status > WARNING:
                raise self.failure("SetRealInputDerivatives", status)

        return slopes, set_slopes

    def bond_input(self, variables: Sequence[Variable]) -> LinearInput:
        """Return the inputs `variables` as inputs of a bond, with slopes if the FMU interpolates."""
        if not self._interpolates:
            return super().bond_input(variables)
        block = self.block("Set", variables)
        return LinearInput(block, self.transfer, *self._slope_call(variables))

    def _initialise(self, starts: Sequence[Start], tolerance: float | None) -> None:
        self.call("SetupExperiment", tolerance is not None, tolerance or 0.0, 0.0, False, 0.0)
        for start in starts:
            self._set_start(start)
        self.call("EnterInitializationMode")
        self.call("ExitInitializationMode")

    def set_inputs(self, inputs: Inputs, tau: float, dt: float) -> None:
        """Set the inputs: value and slope if the FMU interpolates, else the mean over the `dt` seconds."""
        if not self._slope_ports:
            tau += dt / 2
        self._set_blocks.set(inputs, tau)
        self.set_texts(self.text_inputs.changed(inputs))
        if not self._slope_ports:
            return
        rates = [inputs.rate(port) for port in self._slope_ports]
        moves = any(rate is not None for rate in rates)
        if moves or self._moved:
            self._slopes[:] = [0.0 if rate is None else rate[0] for rate in rates]
            self._set_slopes()
        self._moved = moves

    def deserialise(self, state: bytes) -> None:
        """Bring the FMU back to a state from `serialise`, perhaps with slopes of inputs."""
        super().deserialise(state)
        self._moved = bool(self._slope_ports)

    def take_step(self, t: int, h: int, inputs: Inputs) -> Stop:
        """Take a step from `t` to `t + h` (ns) and get the outputs, in one call; return its stop."""
        compiled, outputs = self._set_blocks.compiled, self._read_blocks.compiled
        values, rates = inputs.containers
        is_moving = self._slope_ports and (rates or self._moved)
        if compiled is None or outputs is None or self.ended or is_moving or type(inputs) is not Inputs:
            return super().take_step(t, h, inputs)
        dt = h / 1e9
        stop = compiled.step2(outputs, self._step_address, values, rates, dt / 2, *self._interval(t, h))
        if stop is None:
            return None
        part, at, status = stop
        if part == _OUTPUTS:
            return at, status
        if part == _INPUTS:
            self._set_blocks.go_on(at, status, inputs, dt / 2)
            self.advance(t, h)
        else:
            self._take_failure(status, t, h)
        return outputs.get()

    def advance(self, t: int, h: int) -> None:
        """Bring the FMU from `t` to `t + h` (ns), or to the FMU's end of the simulation."""
        now, size = self._interval(t, h)
        status = self._do_step(self.component, now, size, GOES_ON)
        if status > WARNING:
            self._take_failure(status, t, h)

    def _interval(self, t: int, h: int) -> tuple[float, float]:
        """Return the communication point `t` (ns) and the size of the step to `t + h`, s.

        Point and size of a step add up to the next point in every bit, so an FMU finds no gap between steps,
        except FMUs with steps of a fixed size (FMI 2.0.4 section 4.2.2, fmi2DoStep: "the slave must integrate
        until time instant tc[i+1] = tc[i] + hc[i]").
        """
        now = t / 1e9
        return now, (t + h) / 1e9 - now if self._varies else h / 1e9

    def _take_failure(self, status: int, t: int, h: int) -> None:
        """Note the FMU's end of the simulation; raises SessionError after a failure."""
        reached = ctypes.c_double()
        known = status == DISCARD and self._status("GetRealStatus", _LAST_SUCCESSFUL_TIME, reached)
        ended = ctypes.c_int()
        if status == DISCARD and self._status("GetBooleanStatus", _TERMINATED, ended) and ended.value:
            self._end(reached.value if known else t / 1e9, "fmi2Terminated")
            return
        about = f" for the step from {t / 1e9:.9g} s to {(t + h) / 1e9:.9g} s"
        if known:
            about += f", of which it got to {reached.value:.9g} s"
        raise self.failure("DoStep", status, about)

    def _status(self, function: str, kind: int, value: Any) -> bool:
        """Ask the FMU for a status; return whether the FMU answered."""
        if not self.library.has(f"fmi2{function}"):
            return False
        return self._function(function)(self.component, kind, ctypes.byref(value)) <= WARNING
