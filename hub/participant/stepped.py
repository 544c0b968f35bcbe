"""The interface of engines and controllers."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Protocol, runtime_checkable

from hub.participant.base import Outputs, Participant
from hub.participant.inputs import Inputs
from schemas.errors import StateError
from schemas.ports import BondSide
from schemas.vectors import Vector

__all__ = ["BondPlan", "Correction", "Leaper", "Setup", "Stepped"]


@dataclass(frozen=True)
class Correction:
    """The part of the motion side in `impulse-linearised`.

    F_tool = -F_mean - gain [k (x - x_pred) + b (v - v_pred)].
    """

    gain: float
    stiffness: float
    damping: float


@dataclass(frozen=True)
class BondPlan:
    """The coupling of a participant's bond; passed on to the `ForceSide` or `MotionSide`.

    Examples:
        BondPlan(prediction="velocity", mean=True)     # algorithm `impulse`
    """

    prediction: str
    """The motion assumed by the force side inside a step.

    `hold`, `velocity` (x + v t) or `slope` (x + v t + a t^2/2).
    """
    mean: bool
    """The force side returns the mean force over the step; otherwise the force at the end."""
    correction: Correction | None = None


@dataclass(frozen=True)
class Setup:
    """Arguments of `Stepped.configure`: step, directory, and the participant's connected inputs and bonds."""

    period_ns: int
    """Step of the participant, in nanoseconds."""
    directory: Path
    """Where relative paths of the scenario start."""
    bonds: Mapping[str, BondPlan] = field(default_factory=dict[str, BondPlan])
    connected: frozenset[str] = frozenset()
    """The inputs with a source; an input without a source keeps the start value."""


class Stepped(Participant):
    """An engine or a controller, advanced when, and as far as, the hub grants.

        class Counter(Stepped):
            ports = (Port(name="count", causality="output"),)

            def configure(self, setup: Setup) -> Outputs:
                self.count = np.zeros(1)
                return {"count": self.count}

            def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
                self.count = self.count + 1
                return {"count": self.count}

            def state_hash(self) -> int:
                return state_hash(self.count)

            def close(self) -> None:
                pass

    Equal inputs must give equal bits: a step reads no clock and draws no random number without a seed.
    """

    observer: ClassVar[bool] = False
    """The kind only looks, as a camera does: none of its outputs is part of the simulated world.

    In pace `realtime` such a participant lives in its own time, unless a participant in simulated time reads
    its outputs: each step has the newest inputs and their time `t`, all but the first inputs may be missed,
    and the session does not wait.
    """

    unread: frozenset[str] = frozenset()
    """Outputs not used in this step: no reader, no measure, no recorder, no subscriber.

    The host sets the names before the step. Unread outputs need not be computed, and no state may depend on
    the set. The data for their computation must not be forgotten: somebody may use the outputs in the next
    step.
    """

    @property
    def integration(self) -> str:
        """How an engine integrates its equations, for the plan; empty: as its kind always does."""
        return ""

    @property
    def bonds(self) -> tuple[BondSide, ...]:
        """The bonds available for connection; after `configure` with their effective masses."""
        return ()

    @property
    def ended(self) -> str:
        """Why this participant ends the session, in a clause with the time; empty before the end.

        Read after each grant: the session then ends in good order, with state `done`. Until then the
        participant is stepped on and returns outputs as ever.
        """
        return ""

    @abstractmethod
    def configure(self, setup: Setup) -> Outputs:
        """Build the model, and return every output at time 0."""

    @abstractmethod
    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Advance from `t` to `t + h`, both in nanoseconds, and return the outputs at `t + h`.

        The work of a bond since the start (J) is returned as a float vector of a single element under
        `<bond>/work`.
        """

    @abstractmethod
    def state_hash(self) -> int:
        """Return 64 bits, different for any different bit of the state; equal runs have equal hashes."""

    def save(self) -> bytes:
        """Return the whole state. Raises StateError where the participant cannot."""
        raise StateError(f"participant '{self.name}' ({type(self).__name__}) cannot save its state")

    def restore(self, state: bytes) -> None:  # noqa: ARG002
        """Return to a saved state, bit for bit. Raises StateError where the participant cannot."""
        raise StateError(f"participant '{self.name}' ({type(self).__name__}) cannot restore a state")


@runtime_checkable
class Leaper(Protocol):
    """A participant that can take several steps in one call, with the bits of single steps.

    For environments to learn in, where nothing looks on between two actions.
    """

    def leap(
        self, t: int, h: int, count: int, inputs: Inputs, series: Mapping[str, Vector]
    ) -> tuple[Outputs, Mapping[str, Vector]]:
        """Take `count` steps of `h` ns from `t`; return the last outputs, and series of the outputs.

        A series has the values of a port in each step, shape (count, size). `series` has the inputs that
        change from step to step; all other inputs are constant. An output is missing from the returned
        series if no participant can follow it.
        """
        ...
