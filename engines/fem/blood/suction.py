"""An instrument that takes up blood."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from engines.fem.blood.bleeding import Bleeding
from engines.fem.blood.film import QUANTUM
from engines.fem.probe import Probe
from engines.tissue.probes.suction import SuctionParams
from hub.participant import Inputs, Value, signal_in, signal_out
from schemas.ports import Port
from schemas.vectors import Vector

__all__ = ["Suction", "suction_ports"]

_MOST_AGE_NS = 200_000_000
"""Age at which a command of a silent device is none."""


def suction_ports(probe: str) -> tuple[Port, ...]:
    """Return the ports of an instrument."""
    return (
        signal_in(
            f"{probe}/suction",
            description="share of the most suction, from 0 to 1; 0 from a silent device",
            start=(0.0,),
            max_age_ns=_MOST_AGE_NS,
        ),
        signal_out(f"{probe}/sucked", description="liquid taken up since time 0", unit="ml"),
    )


class Suction:
    """The spheres of a probe as openings of a sucker."""

    def __init__(self, params: SuctionParams, probe: Probe) -> None:
        self._params, self._probe = params, probe
        self.taken: Vector = np.zeros(1)
        """Liquid taken up since time 0, ml."""

    def step(self, inputs: Inputs, bleedings: Sequence[Bleeding], seconds: float) -> None:
        """Take up liquid for `seconds`."""
        port = f"{self._probe.name}/suction"
        command = 0.0 if inputs.stale(port) else inputs.number(port, 0.0)
        if not command > 0.0:  # true of NaN
            return
        left = int(self._params.rate * min(command, 1.0) * seconds / QUANTUM)
        for bleeding in bleedings:
            taken = bleeding.suck(self._probe.positions, self._probe.radii + self._params.reach, left)
            self.taken[0] += 1e6 * QUANTUM * taken
            left -= taken

    @property
    def outputs(self) -> dict[str, Value]:
        """Liquid taken up."""
        return {f"{self._probe.name}/sucked": self.taken.copy()}
