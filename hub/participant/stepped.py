"""The interface of engines and controllers."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

from hub.participant.base import Outputs, Participant
from hub.participant.inputs import Inputs
from schemas.errors import StateError
from schemas.ports import BondSide

__all__ = ["BondPlan", "Correction", "Setup", "Stepped"]


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
    """How one bond of a participant is coupled; passed on to its `ForceSide` or `MotionSide`.

    Examples:
        BondPlan(prediction="velocity", mean=True)     # algorithm `impulse`
    """

    prediction: str
    """The motion that the force side assumes inside a step.

    `hold`, `velocity` (x + v t) or `slope` (x + v t + a t^2/2).
    """
    mean: bool
    """The force side returns its mean force over the step; otherwise the force at its end."""
    correction: Correction | None = None


@dataclass(frozen=True)
class Setup:
    """What `Stepped.configure` receives: step, directory, and what of the participant is connected."""

    period_ns: int
    """Its step, in nanoseconds."""
    directory: Path
    """Where relative paths of the scenario start."""
    bonds: Mapping[str, BondPlan] = field(default_factory=dict[str, BondPlan])
    connected: frozenset[str] = frozenset()
    """The inputs that have a source; any other keeps its start value."""


class Stepped(Participant):
    """An engine or a controller: it advances when, and as far as, the hub grants.

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

    In pace `realtime` such a participant lives in its own time, unless one in simulated time reads it: it is
    stepped with the newest inputs, `t` being theirs, may miss any but the first, and the session does not
    wait for it.
    """

    unread: frozenset[str] = frozenset()
    """Outputs that are not used in this step: no reader, no measure, no recorder, no subscriber.

    The host notes them before the step. What they would be computed from must not be forgotten: somebody may
    use them in the next step. They need not be computed, and no state may depend on them.
    """

    @property
    def bonds(self) -> tuple[BondSide, ...]:
        """The bonds that may be connected; after `configure` with their effective masses."""
        return ()

    @property
    def ended(self) -> str:
        """Why this participant ends the session, in one clause with the time; empty while it goes on.

        It is read when a grant is done: the session then ends in good order, with state `done`. Until there
        the participant is stepped on and returns outputs as ever.
        """
        return ""

    @abstractmethod
    def configure(self, setup: Setup) -> Outputs:
        """Build the model, and return every output at time 0."""

    @abstractmethod
    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Advance from `t` to `t + h`, both in nanoseconds, and return the outputs at `t + h`.

        The work of a bond since the start (J) is returned as a float vector of one element under
        `<bond>/work`.
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
