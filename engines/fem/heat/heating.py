"""The heat of all organs, and the instruments that bring it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from engines.fem.heat.heat import HEAT_PERIOD_NS, Heat
from engines.fem.heat.instrument import EnergyInstrument, energy_ports
from engines.fem.heat.tissue import HeatTissue, tissue_of
from engines.fem.organ import Organ
from engines.tissue.organs.params import OrganParams
from engines.tissue.params import PressedOrgansParams
from hub.participant import Inputs, Value, signal_out
from schemas.ports import Port
from schemas.vectors import Vector

__all__ = ["ElectrodeSpheres", "Heating", "heat_ports"]


def heat_ports(params: PressedOrgansParams) -> tuple[Port, ...]:
    """Return the ports of instruments and of heated organs; none without an instrument."""
    instruments = [name for name, probe in params.probes.items() if probe.energy]
    if not instruments:
        return ()
    organs = (
        port
        for organ in params.organs
        for port in (
            signal_out(f"{organ}/hottest", description="highest temperature of the organ", unit="degC"),
            signal_out(f"{organ}/smoke", description="steam and smoke of the organ", unit="g/s"),
        )
    )
    return *(port for name in instruments for port in energy_ports(name)), *organs


def _tissues(organ: OrganParams) -> list[HeatTissue]:
    """Return the tissues of the layers from the top down, then of the organ's own material."""
    return [tissue_of(name) for name in (*(layer.material for layer in organ.layers), organ.material_name)]


class ElectrodeSpheres(Protocol):
    """The spheres of a probe."""

    @property
    def name(self) -> str:
        """Name of the probe."""
        ...

    @property
    def bodies(self) -> Sequence[int]:
        """The engine's number of every sphere."""
        ...

    @property
    def radii(self) -> Vector:
        """m, shape (n,)."""
        ...

    @property
    def positions(self) -> Vector:
        """Centres, m, in `world`, shape (n, 3)."""
        ...

    @property
    def touching(self) -> NDArray[np.bool_]:
        """Spheres near tissue, shape (n,)."""
        ...

    @property
    def held(self) -> NDArray[np.bool_]:
        """Spheres that hold tissue, shape (n,)."""
        ...


class HeatedTies(Protocol):
    """Ties through which heat goes from organ to organ."""

    def conduct(self, heats: Sequence[Heat], seconds: float) -> None:
        """Let heat go through for `seconds`. `heats`: of all organs."""
        ...


class Heating:
    """A step of heat every 10 ms for each organ that is not cold."""

    def __init__(
        self,
        params: PressedOrgansParams,
        organs: Sequence[Organ],
        probes: Iterable[ElectrodeSpheres],
        ties: HeatedTies | None = None,
    ) -> None:
        """Begin with cold organs. `ties`: of organs that hang together."""
        self._organs, self._ties = organs, ties
        self.heats = [
            Heat(_tissues(params.organs[organ.name]), *organ.solid.elements, len(organ.nodes), organ.layers)
            for organ in organs
        ]
        self._instruments = [
            (EnergyInstrument(probe.name, energy, probe.radii), probe)
            for probe in probes
            if (energy := params.probes[probe.name].energy)
        ]
        self._electrodes = np.array(
            [sphere for _, probe in self._instruments for sphere in probe.bodies], np.int64
        )
        """Spheres with power, by the engine's number."""
        self._edges = [organ.mean_edge for organ in organs]
        self._elapsed = np.zeros(1)
        """Time since the last step of heat, s."""
        self._known = [organ.mesh_version for organ in organs]
        """Versions of the meshes to which the heats are bound."""
        self._smoke = np.zeros(len(organs))
        """Smoke of every organ in the last step of heat, g/s."""

    def step(self, inputs: Inputs, t: int, h: int) -> dict[str, Value]:
        """Advance by `h` ns from `t`; return the outputs."""
        for instrument, _ in self._instruments:
            instrument.listen(inputs, h * 1e-9)
        self._elapsed += h * 1e-9
        if (t + h) // HEAT_PERIOD_NS == t // HEAT_PERIOD_NS:
            return self.outputs
        seconds = float(self._elapsed[0])
        self._elapsed[:] = 0.0
        power, bursts = self._power(seconds)
        for i, heat in enumerate(self.heats):
            burnt = heat.kinds > 0
            self._smoke[i] = (
                1e3
                / seconds
                * heat.advance(seconds, power[i] if power else None, bursts[i] if bursts else None)
            )
            if not heat.is_cold:
                self._burn(self._organs[i], heat, burnt)
        if self._ties is not None:
            self._ties.conduct(self.heats, seconds)
        return self.outputs

    def follow(self) -> None:
        """Take over nodes and elements of organs that have been cut."""
        for i, (organ, heat) in enumerate(zip(self._organs, self.heats, strict=True)):
            if organ.mesh_version != self._known[i]:
                self._known[i] = organ.mesh_version
                heat.rebind(*organ.solid.elements)

    def restore(self, parts: Iterator[bytes]) -> None:
        """Go back to a saved `state`; the organs have gone back already."""
        for array in (
            self._elapsed,
            self._smoke,
            *(instrument.numbers for instrument, _ in self._instruments),
        ):
            array[...] = np.frombuffer(next(parts), array.dtype)
        for organ, heat in zip(self._organs, self.heats, strict=True):
            heat.restore(parts, organ.solid.elements)
        self._known = [organ.mesh_version for organ in self._organs]

    @property
    def outputs(self) -> dict[str, Value]:
        """Temperatures, smoke, and heat given."""
        found: dict[str, Value] = {}
        for organ, heat, smoke in zip(self._organs, self.heats, self._smoke, strict=True):
            found[f"{organ.name}/hottest"] = np.array([heat.hottest])
            found[f"{organ.name}/smoke"] = np.array([smoke])
        for instrument, _ in self._instruments:
            found[f"{instrument.name}/delivered"] = instrument.numbers[1:2].copy()
        return found

    @property
    def state(self) -> tuple[NDArray[Any], ...]:
        """Arrays that the next step depends on, to be written."""
        return (
            self._elapsed,
            self._smoke,
            *(instrument.numbers for instrument, _ in self._instruments),
            *(array for heat in self.heats for array in heat.state),
        )

    def _burn(self, organ: Organ, heat: Heat, was_burnt: NDArray[np.bool_]) -> None:
        """Show burnt tissue, and let vaporised elements go, if the organ may be divided."""
        fresh = np.flatnonzero((heat.kinds > 0) & ~was_burnt)
        if fresh.size:
            organ.note_burnt(fresh, organ.solid.elements[2][fresh], self._electrodes)
        vaporised = heat.vaporised()
        if len(vaporised) and organ.solid.divisible:
            organ.remove(vaporised)
            self.follow()
        organ.colour(heat.kinds)

    def _power(self, seconds: float) -> tuple[list[NDArray[np.float32]], list[NDArray[np.bool_]]]:
        """Return the mean power (W) in every element of every organ, and where a current cuts.

        Shapes (m,); empty: none.
        """
        power: list[NDArray[np.float32]] = []
        bursts: list[NDArray[np.bool_]] = []
        nodes: list[Vector] = []
        for instrument, probe in self._instruments:
            if not instrument.numbers[0]:
                continue
            nodes = nodes or [organ.solid.nodes for organ in self._organs]
            poles = instrument.poles(probe.positions, probe.touching | probe.held)
            given = instrument.deposit(self.heats, nodes, poles, self._edges)
            if given and instrument.cuts:
                cut = [heat > 0.0 for heat in given]
                bursts = [one | other for one, other in zip(bursts, cut, strict=True)] if bursts else cut
            for i, heat in enumerate(given):
                shares = (heat / np.float32(seconds)).astype(np.float32)
                if len(power) > i:
                    power[i] += shares
                else:
                    power.append(shares)
        return power, bursts
