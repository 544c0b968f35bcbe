"""Conversion of an FMU's inputs: another unit, a linear transformation, or a table of whole numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from engines.fmu.variables import port_name
from hub.participant import Inputs
from schemas.errors import ScenarioError, did_you_mean
from schemas.message import Message
from schemas.ports import Port
from schemas.vectors import Vector

__all__ = ["ConvertedInputs", "InputConversion", "convert_ports"]


def _not_zero(value: float) -> float:
    if value == 0.0:
        raise ValueError("a factor of 0 would make the input constant: give a start value instead")
    return value


class InputConversion(BaseModel):
    """Conversion of a connected input on its way to the FMU: `factor * value + offset`, or a table."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    unit: str = Field(
        default="", max_length=100, description="unit of the connected output; default: the FMU's own unit"
    )
    factor: Annotated[float, AfterValidator(_not_zero)] = Field(default=1.0, allow_inf_nan=False)
    offset: float = Field(
        default=0.0, allow_inf_nan=False, description="added after the factor, in the FMU's own unit"
    )
    table: dict[int, int] = Field(
        default={},
        description=(
            "values of integers, enumerations and booleans (0, 1) by the value of the connected output; a"
            " value without an entry is kept"
        ),
    )

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        if self.table and (self.factor, self.offset) != (1.0, 0.0):
            raise ValueError("give a table, or factor and offset, not both")
        return self

    def apply(self, values: Vector) -> Vector:
        """Return the values for the FMU."""
        if not self.table:
            return self.factor * values + self.offset
        return np.array([self.table.get(value, value) for value in values.tolist()], np.float64)


class ConvertedInputs(Inputs):
    """The inputs of a step with conversions applied."""

    def __init__(self, inputs: Inputs, conversions: Mapping[str, InputConversion]) -> None:
        """Read from `inputs`; `conversions` by port."""
        super().__init__({})
        self._inputs = inputs
        self._conversions = conversions

    def __getitem__(self, port: str) -> Vector:
        """Return the vector at the start of the step."""
        conversion = self._conversions.get(port)
        return conversion.apply(self._inputs[port]) if conversion else self._inputs[port]

    def at(self, port: str, tau: float) -> Vector:
        """Return the vector `tau` seconds after the start of the step; values of a table are held."""
        conversion = self._conversions.get(port)
        if conversion is None:
            return self._inputs.at(port, tau)
        return self[port] if conversion.table else conversion.apply(self._inputs.at(port, tau))

    def rate(self, port: str) -> Vector | None:
        """Return the slope (1/s) of an extrapolating connection; None if the value is held."""
        conversion, rate = self._conversions.get(port), self._inputs.rate(port)
        if conversion is None or rate is None:
            return rate
        return None if conversion.table else conversion.factor * rate

    def message(self, port: str) -> Message | None:
        """Return the newest message of a signal without a vector form; None before the first."""
        return self._inputs.message(port)

    def events(self, port: str) -> tuple[Message, ...]:
        """Return the messages received on an event port since the last step, oldest first."""
        return self._inputs.events(port)


def convert_ports(
    ports: Sequence[Port], conversions: Mapping[str, InputConversion]
) -> tuple[tuple[Port, ...], dict[str, InputConversion]]:
    """Return an FMU's ports as other participants see them, and the conversions by port.

    `conversions` by name of the FMU's variable. A converted input has to be connected: the FMU's start value
    has no counterpart in the unit of an output. Raises ScenarioError for a name without an input.
    """
    by_port = {port_name(name): conversion for name, conversion in conversions.items()}
    inputs = {port.name for port in ports if port.causality == "input" and port.limits is None}
    for name in conversions:
        if port_name(name) not in inputs:
            raise ScenarioError(
                f"the FMU has no input '{name}' to convert.{did_you_mean(port_name(name), inputs)}",
                path=("inputs", name),
            )
    seen = tuple(
        port.model_copy(update={"unit": by_port[port.name].unit or port.unit, "start": None})
        if port.name in by_port and port.causality == "input"
        else port
        for port in ports
    )
    return seen, by_port
