"""Which arms and masters are enabled and homed, as far as they have published it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from hub.participant import Inputs
from schemas.crtk import OperatingState

__all__ = ["Readiness"]


class Readiness:
    """The operating states of all arms and masters. All that lasts from step to step is in `state`."""

    def __init__(self, names: Sequence[str]) -> None:
        self._rows = {name: i for i, name in enumerate(names)}
        self.state = np.zeros((len(names), 3))
        """For each: 1 if it has published anything, if it is ENABLED, if it is homed."""
        self.lost: frozenset[str] = frozenset()
        """Those that have stopped being ready in this step."""
        self.new: frozenset[str] = frozenset()
        """Those that have published something for the first time in this step."""

    def receive(self, inputs: Inputs) -> None:
        """Read what they have published."""
        if inputs.quiet:
            self.lost = self.new = frozenset()
            return
        lost: set[str] = set()
        silent = {name for name, row in self._rows.items() if not self.state[row, 0]}
        for name, row in self._rows.items():
            for message in cast("tuple[OperatingState, ...]", inputs.events(f"{name}/operating_state")):
                before = self.is_ready(name)
                self.state[row] = 1.0, message.state == "ENABLED", message.is_homed
                if before and not self.is_ready(name):
                    lost.add(name)
        self.lost = frozenset(lost)
        self.new = frozenset(name for name in silent if self.state[self._rows[name], 0])

    def is_ready(self, name: str) -> bool:
        """Say whether it is ENABLED and homed."""
        return bool(self.state[self._rows[name]].all())

    def may_lead(self, master: str) -> bool:
        """Say whether a master may lead: one that has no operating state, such as a stylus, may."""
        return self.is_ready(master) or not self.state[self._rows[master], 0]

    def orders(self, name: str) -> tuple[str, ...]:
        """Return the state commands that make it ready; none before it has published its state."""
        known, enabled, homed = self.state[self._rows[name]]
        return () if not known else (*(() if enabled else ("enable",)), *(() if homed else ("home",)))
