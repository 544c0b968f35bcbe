"""The base of every participant: name, parameters and ports."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from types import TracebackType
from typing import Any, ClassVar, Self

from pydantic import BaseModel, ConfigDict

from schemas.message import Message
from schemas.ports import Port
from schemas.vectors import Vector

__all__ = ["Outputs", "Params", "Participant", "Value"]

Value = Vector | Message | tuple[Message, ...]
"""The value of a port: a float64 vector of shape (size,), a message, or a tuple of messages.

A signal with a fixed layout is a vector, all other signals a message, an event port a tuple of messages.
"""


Outputs = Mapping[str, Value]
"""Port name to value. The arrays may be the same at every step: copy a value to keep it."""


class Params(BaseModel):
    """Base of the parameters of a participant kind in a scenario; in SI units once validated.

        class SpringParams(Params):
            rest: Length = 0.08                                   # m; "80 mm" in a scenario
            stiffness: Annotated[Stiffness, Field(gt=0)] = 100.0  # N/m

    Unknown keys are errors, with file, line and column.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    native_code: ClassVar[tuple[str, ...]] = ()
    """Names of the parameters for files of native code, such as a vendor's library.

    A recording with such a parameter is re-simulated only with `--trust`.
    """

    open_to_pages: ClassVar[bool] = False
    """Whether a page in the browser may change the numbers, switches and choices of this model.

    Set to True where no parameter reaches a file, a device or a network. A derived model has to repeat the
    value.
    """


class Participant(ABC):
    """The common part of engines, controllers and devices: a name, parameters and ports."""

    params_model: ClassVar[type[Params]] = Params
    """The pydantic model of the kind's parameters."""

    def __init__(self, name: str, params: Any) -> None:
        """Store the participant's name and an instance of `params_model`.

        Import no package of an extra here: scenarios are checked without the extra's packages.
        """
        self.name = name
        self.params = params

    @property
    @abstractmethod
    def ports(self) -> tuple[Port, ...]:
        """Inputs and outputs, readable before anything is started; without the ports of bonds."""

    @abstractmethod
    def close(self) -> None:
        """Release everything. May be called twice, and before or after a failed `configure` or `open`."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
