"""A clip applier: two jaws that leave a clip on the tube between them."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

import numpy as np

from engines.fem.blood.bleeding import Bleeding
from engines.fem.blood.clips import MOST_CLIPS
from engines.fem.probe import Probe
from engines.tissue.probes.clip import ClipParams
from engines.tissue.warn_once import warn_once
from hub.participant import Inputs, event_in
from schemas.ports import Port
from schemas.ros import EmptyMessage
from schemas.vectors import Vector

__all__ = ["ClipApplier", "clip_ports"]

CLIPPED, SLIPPED, NOT_ACROSS = "clipped", "clip slipped", "clip not across"


def clip_ports(probe: str) -> tuple[Port, ...]:
    """Return the ports of a clip applier."""
    return (event_in(f"{probe}/clip", EmptyMessage, "closes a clip on what is between the jaws"),)


class ClipApplier:
    """The first half of a probe's spheres as one jaw, the second half as the other."""

    def __init__(self, params: ClipParams, probe: Probe) -> None:
        self._params, self._probe = params, probe

    def step(self, inputs: Inputs, bleedings: Sequence[Bleeding]) -> None:
        """Close a clip if there is a command."""
        if inputs.events(f"{self._probe.name}/clip"):
            self._close(bleedings)

    def _close(self, bleedings: Sequence[Bleeding]) -> None:
        jaws = self._probe.positions.reshape(2, -1, 3).mean(axis=1)
        middle = jaws.mean(axis=0)
        tubes = [(one, *one.lumen.nearest(middle)) for one in bleedings if one.lumen is not None]
        if not tubes:
            return self._warn("there is no tube to be clipped")
        bleeding, ring, offset = min(tubes, key=lambda tube: float(np.linalg.norm(tube[2])))
        problem, kind = self._misfit(bleeding, ring, jaws, offset), SLIPPED
        if not problem and not self._spans(bleeding, ring, jaws, offset):
            problem = f"organ '{bleeding.organ.name}' is not wholly between the jaws"
            kind = NOT_ACROSS
        if not problem and bleeding.clips is not None:
            if bleeding.clips.put(ring, jaws[1] - jaws[0], self._params):
                bleeding.organ.events.say(CLIPPED, self._probe.name, middle, self._params.width, "m")
                return None
            problem = f"organ '{bleeding.organ.name}' has {MOST_CLIPS} clips already"
        bleeding.organ.events.say(kind, self._probe.name, middle, self._diameter(bleeding, ring), "m")
        return self._warn(problem)

    def _diameter(self, bleeding: Bleeding, ring: int) -> float:
        """Return the outer diameter of a tube at a ring, m."""
        return 0.0 if bleeding.lumen is None else float(bleeding.lumen.diameters[ring])

    def _misfit(self, bleeding: Bleeding, ring: int, jaws: Vector, offset: Vector) -> str:
        """Return why a clip does not hold at a ring; empty: it holds. `offset`: to the tube, m."""
        diameter, (least, most) = self._diameter(bleeding, ring), self._params.diameters
        spread = float(np.linalg.norm(jaws[1] - jaws[0]))
        name = bleeding.organ.name
        if float(np.linalg.norm(offset)) > 0.5 * (diameter + spread):
            return f"organ '{name}' is not between the jaws"
        if diameter < least:
            return (
                f"organ '{name}' of {1e3 * diameter:.3g} mm is too little for a clip of"
                f" {1e3 * least:.3g} mm or more"
            )
        flat = 0.5 * pi * diameter
        if diameter > most or flat > self._params.length:
            return (
                f"organ '{name}' of {1e3 * diameter:.3g} mm, flat {1e3 * flat:.3g} mm, is too much for a clip"
                f" of {1e3 * self._params.length:.3g} mm for {1e3 * most:.3g} mm at most"
            )
        return ""

    def _spans(self, bleeding: Bleeding, ring: int, jaws: Vector, offset: Vector) -> bool:
        """Return whether a clip reaches across a flattened ring, with a slack of half its diameter."""
        diameter = self._diameter(bleeding, ring)
        closing = (jaws[1] - jaws[0]) / max(float(np.linalg.norm(jaws[1] - jaws[0])), 1e-9)
        aside = offset - float((offset * closing).sum()) * closing
        half = 0.25 * pi * diameter
        return float(np.linalg.norm(aside)) + half <= 0.5 * self._params.length + 0.5 * diameter

    def _warn(self, problem: str) -> None:
        warn_once(f"probe '{self._probe.name}': a clip slipped: {problem}")
