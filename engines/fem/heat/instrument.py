"""An electrosurgical instrument: power over time, and the poles of its current in tissue."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from engines.fem.heat.heat import Heat
from engines.tissue.probes.energy import EnergyParams
from engines.tissue.warn_once import warn_once
from hub.participant import Inputs, signal_in, signal_out
from schemas.ports import Port
from schemas.vectors import Vector

__all__ = ["EnergyInstrument", "energy_ports"]

_REACH = 4.0
"""Radii from a pole within which tissue is heated: beyond, a sphere in a homogeneous body leaves a quarter of
its heat, of low density.
"""
_MOST_AGE_NS = 200_000_000
"""Age at which a command of a silent device is none."""


def energy_ports(probe: str) -> tuple[Port, ...]:
    """Return the ports of an instrument."""
    return (
        signal_in(
            f"{probe}/energy",
            description="power of the generator; 0 from a silent device",
            unit="W",
            start=(0.0,),
            max_age_ns=_MOST_AGE_NS,
        ),
        signal_out(f"{probe}/delivered", description="heat given to tissue since time 0", unit="J"),
    )


_LONGEST_IDLE_S = 1.0
"""Time of power without contact after which a warning says so: a hook leaves tissue for moments."""

Deposit = list[NDArray[np.float32]]
"""Heat in every element of every body, J; empty: none."""


class EnergyInstrument:
    """The spheres of a probe as electrodes.

    A monopolar current leaves by the touching spheres in equal parts; a bipolar current goes from jaw to jaw.
    """

    def __init__(self, name: str, params: EnergyParams, radii: Vector) -> None:
        self.name, self.reach = name, _REACH * float(radii[: params.bare].max())
        self.numbers: Vector = np.zeros(3)
        """Heat that waits for the next step of heat, and heat given since time 0, J; time with power
        since the last contact, s.
        """
        self._params, self._radii = params, radii
        self.cuts = params.effect == "cut"
        """Whether steam takes dried tissue away."""
        self._conducts: NDArray[np.bool_] = np.arange(len(radii)) < (params.bare or len(radii))

    def listen(self, inputs: Inputs, seconds: float) -> None:
        """Collect the power of a step."""
        port = f"{self.name}/energy"
        power = 0.0 if inputs.stale(port) else inputs.number(port, 0.0)
        if power > 0.0:  # false of NaN
            self.numbers[0] += self._params.efficiency * min(power, self._params.power) * seconds
            self.numbers[2] += seconds

    def poles(self, centres: Vector, touching: NDArray[np.bool_]) -> Vector:
        """Return centre, radius and signed current of every pole, shape (p, 5).

        Insulated spheres are none.

        No pole without contact, of a bipolar instrument without contact of both jaws.
        """
        touching = touching & self._conducts
        current = touching / max(1, int(touching.sum()))
        if self._params.mode == "bipolar":
            first = np.arange(len(touching)) < len(touching) // 2
            one, other = touching & first, touching & ~first
            if not (one.any() and other.any()):
                return np.zeros((0, 5))
            current = one / one.sum() - other / other.sum()
        return np.column_stack([centres, self._radii, current])[touching]

    def deposit(
        self, heats: Sequence[Heat], nodes: Sequence[Vector], poles: Vector, edges: Sequence[float]
    ) -> Deposit:
        """Return the heat (J) in every element of every body, shapes (m,), since the last call.

        `nodes`: present nodes of every body, m, shapes (n, 3). `edges`: mean length of its edges, m: an
        element has the heat of its middle, so the mesh of a body widens the reach in this body.
        """
        waiting, self.numbers[0] = float(self.numbers[0]), 0.0
        if not waiting:
            return []
        found = [
            heat.spread(at, poles, self.reach + edge)
            for heat, at, edge in zip(heats, nodes, edges, strict=True)
        ]
        total = sum(share for _, share in found)
        if not total:
            if self.numbers[2] >= _LONGEST_IDLE_S:
                warn_once(
                    f"probe '{self.name}': power without contact heats nothing; a bipolar instrument needs"
                    " tissue at both jaws"
                )
            return []
        self.numbers[1] += waiting
        self.numbers[2] = 0.0
        return [np.float32(waiting / total) * shares for shares, _ in found]
