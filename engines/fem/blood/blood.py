"""The blood of all organs, and the instruments that take it up."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engines.fem.blood.bleeding import Bleeding
from engines.fem.blood.clip import ClipApplier, clip_ports
from engines.fem.blood.clip_markers import clip_markers
from engines.fem.blood.irrigation import Irrigation, irrigation_ports, saline_outputs, saline_ports
from engines.fem.blood.suction import Suction, suction_ports
from engines.fem.blood.tube_events import tube_ports
from engines.fem.blood.tube_line import line_port
from engines.fem.organ import Organ
from engines.fem.probe import Probe
from engines.tissue.organs.params import OrganParams
from engines.tissue.params import PressedOrgansParams
from hub.participant import Inputs, Value, signal_out
from schemas.ports import Port
from schemas.trocar_msgs import ShownMarkers, SurfaceFilm
from schemas.vectors import Vector

__all__ = ["Blood", "bleeds", "blood_ports"]


def blood_ports(params: PressedOrgansParams) -> tuple[Port, ...]:
    """Return the ports of organs that bleed and of instruments with suction; none without such an organ."""
    organs = [name for name, organ in params.organs.items() if bleeds(organ)]
    if not organs:
        return ()
    suctions = [name for name, probe in params.probes.items() if probe.suction]
    irrigations = [name for name, probe in params.probes.items() if probe.irrigation]
    clips = [name for name, probe in params.probes.items() if probe.clip]
    tubes = [name for name, organ in params.organs.items() if organ.lumen]
    return (
        *(port for organ in organs for port in _organ_ports(organ, params.node_period)),
        *(line_port(organ, params.node_period) for organ in tubes),
        *(port for organ in tubes for port in tube_ports(organ, params.node_period)),
        *(
            signal_out(f"{name}/spilled", description="liquid that the sac has lost", unit="ml")
            for name, organ in params.organs.items()
            if organ.lumen and organ.lumen.volume
        ),
        *(port for name in suctions for port in suction_ports(name)),
        *(port for name in irrigations for port in irrigation_ports(name)),
        *(port for name in organs if irrigations for port in saline_ports(name)),
        *(port for name in clips for port in clip_ports(name)),
        *((_clip_bodies(params.node_period),) if clips else ()),
    )


def _clip_bodies(period_ns: int) -> Port:
    shown = "closed clips, for the input `markers` of cameras"
    return signal_out("clips", ShownMarkers, shown, frame="world", period_ns=period_ns)


def _organ_ports(organ: str, period_ns: int) -> tuple[Port, ...]:
    film = "thickness of the liquid on the surface"
    return (
        signal_out(f"{organ}/bleeding", description="flow of blood, or of bile", unit="ml/s"),
        signal_out(f"{organ}/blood/lost", description="lost since time 0", unit="ml"),
        signal_out(f"{organ}/blood/surface", description="of it still on the surface", unit="ml"),
        signal_out(f"{organ}/film", SurfaceFilm, film, frame="world", period_ns=period_ns),
    )


def bleeds(organ: OrganParams) -> bool:
    """Return whether liquid may come out of an organ."""
    return organ.bleeding is not None or organ.lumen is not None


_NO_CLIPS = clip_markers((), 0)


class Blood:
    """A step of blood whenever the nodes have been read, every 8 ms."""

    def __init__(
        self,
        params: PressedOrgansParams,
        organs: Sequence[Organ],
        probes: Sequence[Probe],
    ) -> None:
        """Begin with dry organs."""
        irrigated = any(params.probes[probe.name].irrigation for probe in probes)
        self.bleedings = [
            Bleeding(organ, params.organs[organ.name], params.gravity, irrigated=irrigated)
            for organ in organs
            if bleeds(params.organs[organ.name])
        ]
        self._suctions = [
            Suction(suction, probe)
            for probe in probes
            if (suction := params.probes[probe.name].suction) is not None
        ]
        self._irrigations = [
            Irrigation(irrigation, probe)
            for probe in probes
            if (irrigation := params.probes[probe.name].irrigation) is not None
        ]
        self._appliers = [
            ClipApplier(clip, probe)
            for probe in probes
            if (clip := params.probes[probe.name].clip) is not None
        ]
        self._organs = organs
        self._elapsed = np.zeros(1)
        """Time since the last step of blood, s."""
        self.outputs = self._read()
        """Flows and volumes at the last step of blood."""

    def step(self, inputs: Inputs, t: int, h: int, *, looked: bool) -> dict[str, Value]:
        """Go on by `h` ns to `t`, where the nodes have been read if `looked`; return the outputs."""
        self._elapsed += h * 1e-9
        for applier in self._appliers:
            applier.step(inputs, self.bleedings, self._organs)
        if looked:
            seconds = float(self._elapsed[0])
            self._elapsed[:] = 0.0
            for bleeding in self.bleedings:
                bleeding.step(t, seconds)
            for instrument in (*self._irrigations, *self._suctions):
                instrument.step(inputs, self.bleedings, seconds)
            self.outputs = self._read()
        happened = ((f"{one.organ.name}/tube", one.tube) for one in self.bleedings if one.tube is not None)
        return self.outputs | {port: tube.finish(t) for port, tube in happened}

    def pictures(self, t: int) -> dict[str, Value]:
        """Return the films, the middle lines of tubes, and the clips, at `t` ns."""
        found: dict[str, Value] = {f"{one.organ.name}/film": one.picture(t) for one in self.bleedings}
        for one in self.bleedings:
            if one.tube is not None and (line := one.line(t)) is not None:
                found[f"{one.organ.name}/line"], found[f"{one.organ.name}/clips"] = line, one.tube.clips(t)
        return found | {"clips": self._clip_bodies(t)} if self._appliers else found

    def _clip_bodies(self, t: int) -> ShownMarkers:
        """Return the clips on all tubes; the same object as long as there is none."""
        tubes = [(one.organ.name, one.clips) for one in self.bleedings if one.clips is not None]
        bodies = [(name, body) for name, clips in tubes for body in clips.bodies]
        return clip_markers(bodies, t) if bodies else _NO_CLIPS

    def restore(self, parts: Iterator[bytes]) -> None:
        """Go back to a saved `state`; the organs have gone back already."""
        for array in (self._elapsed, *self._totals):
            array[...] = np.frombuffer(next(parts), array.dtype)
        for bleeding in self.bleedings:
            bleeding.restore(parts)
        self.outputs = self._read()

    def _read(self) -> dict[str, Value]:
        found: dict[str, Value] = {}
        for bleeding in self.bleedings:
            name, volumes = bleeding.organ.name, bleeding.volumes
            found[f"{name}/bleeding"] = np.array([bleeding.rate])
            if bleeding.tube is not None:
                found[f"{name}/tube"] = ()
            if bleeding.lumen is not None and (spilled := bleeding.lumen.spilled) is not None:
                found[f"{name}/spilled"] = spilled
            found[f"{name}/blood/lost"], found[f"{name}/blood/surface"] = volumes[:1], volumes[1:2]
            found |= saline_outputs(bleeding) if self._irrigations else {}
        for instrument in (*self._suctions, *self._irrigations):
            found.update(instrument.outputs)
        return found

    @property
    def _totals(self) -> tuple[Vector, ...]:
        """Liquid taken up and let out by each instrument, ml."""
        return *(one.taken for one in self._suctions), *(one.given for one in self._irrigations)

    @property
    def amounts(self) -> tuple[NDArray[np.int64], ...]:
        """Liquid at every node, and the book, of every organ: from these all else follows."""
        return tuple(array for bleeding in self.bleedings for array in bleeding.amounts)

    @property
    def state(self) -> tuple[NDArray[Any], ...]:
        """Arrays that the next step depends on."""
        return (
            self._elapsed,
            *self._totals,
            *(array for bleeding in self.bleedings for array in bleeding.state),
        )
