"""Readiness of arms and masters (enabled and homed), as published by them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from hub.participant import Inputs
from schemas.crtk import OperatingState

__all__ = ["Readiness"]


class Readiness:
    """The operating states of all arms and masters. Everything that lasts from step to step is in `state`."""

    def __init__(self, names: Sequence[str]) -> None:
        self._rows = {name: i for i, name in enumerate(names)}
        self.state = np.zeros((len(names), 3))
        """Flags of each arm or master: 1 if any state was published, if ENABLED, if homed."""
        self.lost: frozenset[str] = frozenset()
        """Names that have stopped being ready in this step."""
        self.new: frozenset[str] = frozenset()
        """Names that have published a state for the first time in this step."""

    def receive(self, inputs: Inputs) -> None:
        """Read the published operating states."""
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
        """Return whether an arm or master is ENABLED and homed."""
        return bool(self.state[self._rows[name]].all())

    def may_lead(self, master: str) -> bool:
        """Return whether a master may lead: a master without an operating state, such as a stylus, may."""
        return self.is_ready(master) or not self.state[self._rows[master], 0]

    def state_commands(self, name: str) -> tuple[str, ...]:
        """Return the state commands to make an arm ready; none before the arm has published its state."""
        known, enabled, homed = self.state[self._rows[name]]
        return () if not known else (*(() if enabled else ("enable",)), *(() if homed else ("home",)))
