"""A participant without any computation, 64 doubles in and 64 out, to measure the cost of a step itself."""

import numpy as np

from hub.participant import Inputs, Outputs, Setup, Stepped
from schemas.ports import Port

SIZE = 64


class Exchange(Stepped):
    """Publishes its input."""

    ports = (
        Port(name="taken", causality="input", size=SIZE),
        Port(name="given", causality="output", size=SIZE),
    )

    def configure(self, setup: Setup) -> Outputs:
        """Start from zeros."""
        self._value = np.zeros(SIZE)
        return {"given": self._value}

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Give what was taken."""
        self._value = inputs["taken"]
        return {"given": self._value}

    def state_hash(self) -> int:
        """No hash: hashing belongs to the engine's own cost."""
        return 0

    def close(self) -> None:
        """Nothing is held."""
