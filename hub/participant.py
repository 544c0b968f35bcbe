"""The participant side: what engines, controllers and devices build on.

A stepped participant (engine, controller) declares its ports, is configured, and is then told to step; a device
lives in wall time and is read and written. Neither knows in which process it or its neighbours run.
"""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from time import sleep
from types import TracebackType
from typing import Any, ClassVar, Self

import numpy as np
import zenoh
from pydantic import BaseModel, ConfigDict

from hub.inputs import Inputs
from schemas.errors import StateError
from schemas.message import Message
from schemas.ports import BondSide, Port
from schemas.vectors import Vector

__all__ = ["BondPlan", "Correction", "Device", "Outputs", "Params", "Sample", "Setup", "Stepped", "Value", "restore_arrays", "state_hash"]

Value = Vector | Message | tuple[Message, ...]
"""A signal with a fixed layout is a vector, any other signal a message, an event port a tuple of messages."""

Outputs = Mapping[str, Value]
"""Port name to value. The arrays may be the same ones at every step: whoever keeps a value copies it."""


class Params(BaseModel):
    """Base of the parameters of a participant kind, as they stand in a scenario. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)


@dataclass(frozen=True)
class Correction:
    """The motion side's share of `impulse-linearised`: F_tool = -F_mean - gain [k (x - x_pred) + b (v - v_pred)]."""

    gain: float
    stiffness: float
    damping: float


@dataclass(frozen=True)
class BondPlan:
    """How one bond of this participant is coupled."""

    prediction: str
    """What the force side assumes of the motion inside a step: `hold`, `velocity` (x + v t) or `slope` (x + v t + a t^2/2)."""
    mean: bool
    """The force side returns its mean force over the step; otherwise the force at its end."""
    correction: Correction | None = None


@dataclass(frozen=True)
class Setup:
    """All that a participant learns when it is configured."""

    period_ns: int
    """Its step, in nanoseconds."""
    directory: Path
    """Where relative paths of the scenario start."""
    bonds: Mapping[str, BondPlan] = field(default_factory=dict[str, BondPlan])


class _Participant(ABC):
    params_model: ClassVar[type[Params]] = Params
    """The pydantic model of the kind's parameters."""

    def __init__(self, name: str, params: Any) -> None:
        """Take the participant's name and an instance of `params_model`. Cheap: no package of an extra is imported here."""
        self.name = name
        self.params = params

    @property
    @abstractmethod
    def ports(self) -> tuple[Port, ...]:
        """Inputs and outputs, readable before anything is started; those of bonds not among them."""

    @abstractmethod
    def close(self) -> None:
        """Give everything back. May be called twice, and before or after a failed `configure` or `open`."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


class Stepped(_Participant):
    """An engine or a controller: advances when, and as far as, it is told to."""

    @property
    def bonds(self) -> tuple[BondSide, ...]:
        """Power bonds that may be connected; after `configure` with their effective masses."""
        return ()

    @abstractmethod
    def configure(self, setup: Setup) -> Outputs:
        """Build the model, and return every output at time 0."""

    @abstractmethod
    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Advance from `t` to `t + h`, both in nanoseconds, and return the outputs at `t + h`.

        The work of a bond since the start (J) is returned as a float vector of one element under `<bond>/work`.
        """

    @abstractmethod
    def state_hash(self) -> int:
        """Return 64 bits that differ whenever any bit of the state differs; equal runs have equal hashes."""

    def save(self) -> bytes:
        """Return the whole state. Raises StateError where the participant cannot."""
        raise StateError(f"participant '{self.name}' ({type(self).__name__}) cannot save its state")

    def restore(self, state: bytes) -> None:  # noqa: ARG002
        """Return to a saved state, bit for bit. Raises StateError where the participant cannot."""
        raise StateError(f"participant '{self.name}' ({type(self).__name__}) cannot restore a state")


@dataclass(frozen=True)
class Sample:
    """One message of a device, stamped in the clock of its port."""

    port: str
    message: Message


class Device(_Participant):
    """A participant that lives in wall time, or, if it can play by a script, in simulated time."""

    read_period_ns: ClassVar[int] = 1_000_000
    """How often it is read in wall time where the scenario does not say; a haptic stylus moves and is felt at 1 kHz."""

    @property
    def foreign_keys(self) -> tuple[str, ...]:
        """Zenoh keys, none of Trocar's own, that programs and this device share at the hub's router: who has the certificate `console` may use them."""
        return ()

    def learn_hub(self, connect: Callable[[], zenoh.Session]) -> None:
        """Take, before `open`, what opens a Zenoh session of one's own with the hub. Only a device with foreign keys needs one."""

    @abstractmethod
    def open(self, directory: Path) -> None:
        """Start the device; relative paths of the scenario start at `directory`."""

    @abstractmethod
    def read(self, t: int) -> Iterable[Sample]:
        """Return what is new up to time `t` (ns since the session's start, wall or simulated), oldest first."""

    def wait(self, seconds: float) -> bool:
        """Wait in the thread that reads, until the next period; a device that knows when it has something new returns at once, True, and is read."""
        sleep(seconds)
        return False

    def write(self, port: str, value: Value) -> None:
        """Take the newest value of a signal, or the next message of an event port. A device without inputs is never written to."""


def state_hash(*parts: bytes | Vector) -> int:
    """Return a 64-bit hash of `parts`, the same on every machine that has the same bits."""
    digest = hashlib.blake2b(digest_size=8)
    for part in parts:
        digest.update(part if isinstance(part, bytes) else part.tobytes())
    return int.from_bytes(digest.digest(), "little")


def restore_arrays(participant: str, arrays: Iterable[Vector], state: bytes) -> None:
    """Write `state`, the bytes of `arrays` one after the other, back into them. Raises StateError if it has another size."""
    held = tuple(arrays)
    size = sum(array.nbytes for array in held)
    if len(state) != size:
        raise StateError(f"participant '{participant}': a saved state of {len(state)} bytes, expected {size}; was it saved elsewhere?")
    values, at = np.frombuffer(state), 0
    for array in held:
        array[...] = values[at : at + array.size].reshape(array.shape)
        at += array.size
