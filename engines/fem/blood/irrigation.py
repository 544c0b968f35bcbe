"""An instrument that rinses tissue with saline."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from engines.fem.blood.bleeding import Bleeding
from engines.fem.blood.film import QUANTUM
from engines.fem.blood.flow_command import commanded_share, flow_port
from engines.fem.probe import Probe
from engines.tissue.probes.irrigation import IrrigationParams
from hub.participant import Inputs, Value, signal_out
from schemas.ports import Port
from schemas.vectors import Vector

__all__ = ["Irrigation", "irrigation_ports", "saline_outputs", "saline_ports"]

_SALINE = (
    ("given", "saline let fall on it since time 0"),
    ("surface", "of it still on the surface"),
    ("dripped", "of it dripped off"),
    ("sucked", "of it sucked up"),
)


def irrigation_ports(probe: str) -> tuple[Port, ...]:
    """Return the ports of an instrument."""
    return (
        flow_port(f"{probe}/irrigation", "irrigation"),
        signal_out(f"{probe}/irrigated", description="saline let out since time 0", unit="ml"),
    )


def saline_ports(organ: str) -> tuple[Port, ...]:
    """Return the outputs of an organ that may be irrigated."""
    return tuple(
        signal_out(f"{organ}/saline/{name}", description=meaning, unit="ml") for name, meaning in _SALINE
    )


def saline_outputs(bleeding: Bleeding) -> dict[str, Value]:
    """Return the values of `saline_ports`."""
    values = bleeding.saline
    name = bleeding.organ.name
    return {f"{name}/saline/{what}": values[i : i + 1] for i, (what, _) in enumerate(_SALINE)}


class Irrigation:
    """The first sphere of a probe as the opening of an irrigator."""

    def __init__(self, params: IrrigationParams, probe: Probe) -> None:
        self._params, self._probe = params, probe
        self.given: Vector = np.zeros(1)
        """Saline let out since time 0, ml."""

    def step(self, inputs: Inputs, bleedings: Sequence[Bleeding], seconds: float) -> None:
        """Let saline fall on the first organ in reach for `seconds`; without any it falls past them."""
        share = commanded_share(inputs, f"{self._probe.name}/irrigation")
        if not share:
            return
        amount = int(self._params.rate * share * seconds / QUANTUM)
        self.given[0] += 1e6 * QUANTUM * amount
        reach = float(self._probe.radii[0]) + self._params.reach
        for bleeding in bleedings:
            if bleeding.irrigate(self._probe.positions[0], reach, amount):
                return

    @property
    def outputs(self) -> dict[str, Value]:
        """Saline let out."""
        return {f"{self._probe.name}/irrigated": self.given.copy()}
