"""An instrument that takes up blood."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from engines.fem.blood.bleeding import Bleeding
from engines.fem.blood.film import QUANTUM
from engines.fem.blood.flow_command import commanded_share, flow_port
from engines.fem.probe import Probe
from engines.tissue.probes.suction import SuctionParams
from hub.participant import Inputs, Value, signal_out
from schemas.ports import Port
from schemas.vectors import Vector

__all__ = ["Suction", "suction_ports"]


def suction_ports(probe: str) -> tuple[Port, ...]:
    """Return the ports of an instrument."""
    return (
        flow_port(f"{probe}/suction", "suction"),
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
        share = commanded_share(inputs, f"{self._probe.name}/suction")
        if not share:
            return
        left = int(self._params.rate * share * seconds / QUANTUM)
        for bleeding in bleedings:
            taken = bleeding.suck(self._probe.positions, self._probe.radii + self._params.reach, left)
            self.taken[0] += 1e6 * QUANTUM * taken
            left -= taken

    @property
    def outputs(self) -> dict[str, Value]:
        """Liquid taken up."""
        return {f"{self._probe.name}/sucked": self.taken.copy()}
