"""A clip applier: two jaws that leave a clip on the tube between them."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import NamedTuple

import numpy as np

from engines.fem.blood.between_jaws import organs_between
from engines.fem.blood.bleeding import Bleeding
from engines.fem.blood.clips import MOST_CLIPS
from engines.fem.blood.lumen import Lumen
from engines.fem.organ import Organ
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


class _Caught(NamedTuple):
    """A tube between the jaws."""

    bleeding: Bleeding
    lumen: Lumen
    ring: int
    offset: Vector
    """Way from the middle of the jaws to the tube, m, shape (3,)."""

    @property
    def name(self) -> str:
        """Name of the organ."""
        return self.bleeding.organ.name

    @property
    def diameter(self) -> float:
        """Outer diameter, m."""
        return float(self.lumen.diameters[self.ring])


class ClipApplier:
    """The first half of a probe's spheres as one jaw, the second half as the other.

    A clip shuts all tubes between the jaws, if they fit into it together, and slips off other tissue.
    """

    def __init__(self, params: ClipParams, probe: Probe) -> None:
        self._params, self._probe = params, probe

    def step(self, inputs: Inputs, bleedings: Sequence[Bleeding], organs: Sequence[Organ]) -> None:
        """Close a clip if there is a command."""
        if inputs.events(f"{self._probe.name}/clip"):
            self._close(bleedings, organs)

    def _close(self, bleedings: Sequence[Bleeding], organs: Sequence[Organ]) -> None:
        jaws = self._probe.positions.reshape(2, -1, 3)
        ends = jaws.mean(axis=1)
        middle = ends.mean(axis=0)
        tubes = [
            _Caught(one, one.lumen, *one.lumen.nearest(middle))
            for one in bleedings
            if one.lumen is not None and one.lumen.along.size
        ]
        if not tubes:
            return self._warn("there is no tube to be clipped")
        tubes.sort(key=lambda tube: float(np.linalg.norm(tube.offset)))
        between = organs_between(organs, jaws, tubes[0].lumen.direction(tubes[0].ring), self._params)
        caught = [tube for tube in tubes if tube is tubes[0] or tube.name in between]
        problem, kind = self._misfit(caught, sorted(between - {tube.name for tube in caught}), ends), SLIPPED
        if not problem and len(caught) == 1 and not self._spans(tubes[0], ends):
            problem, kind = f"organ '{tubes[0].name}' is not wholly between the jaws", NOT_ACROSS
        for tube in caught:
            others = sorted((between | {one.name for one in caught}) - {tube.name})
            self._put(tube, ends, others, kind, problem)
        return None

    def _put(self, tube: _Caught, ends: Vector, others: Sequence[str], kind: str, problem: str) -> None:
        """Close the clip on one of the caught tubes, or say, as an event of this kind, why not."""
        bleeding, probe = tube.bleeding, self._probe.name
        middle, closing = ends.mean(axis=0), ends[1] - ends[0]
        assert bleeding.clips is not None
        assert bleeding.tube is not None
        number = -1 if problem else bleeding.clips.put(tube.ring, closing, self._params, probe)
        if number >= 0:
            bleeding.organ.events.say(CLIPPED, probe, middle, self._params.width, "m")
            bleeding.tube.say_clipped(number, tube.ring, middle, probe, others)
            return
        cause = problem or f"organ '{tube.name}' has had {MOST_CLIPS} clips already"
        bleeding.organ.events.say(kind, probe, middle, tube.diameter, "m")
        bleeding.tube.say_slipped(kind, tube.ring, middle, probe, others, cause)
        self._warn(cause)

    def _misfit(self, caught: Sequence[_Caught], others: Sequence[str], ends: Vector) -> str:
        """Return why a clip does not hold; empty: it holds.

        `others`: organs between the jaws that are no tubes; `ends`: middles of the jaws, m, shape (2, 3).
        """
        first, (least, most) = caught[0], self._params.diameters
        spread = float(np.linalg.norm(ends[1] - ends[0]))
        name, diameter = first.name, sum(tube.diameter for tube in caught)
        if float(np.linalg.norm(first.offset)) > 0.5 * (first.diameter + spread):
            return f"organ '{name}' is not between the jaws"
        if others:
            return f"organ '{others[0]}' is between the jaws too: take hold of '{name}' alone"
        if diameter < least:
            return (
                f"organ '{name}' of {1e3 * diameter:.3g} mm is too little for a clip of"
                f" {1e3 * least:.3g} mm or more"
            )
        flat, names = 0.5 * pi * diameter, "', '".join(tube.name for tube in caught)
        if diameter > most or flat > self._params.length:
            return (
                f"organ '{names}' of {1e3 * diameter:.3g} mm, flat {1e3 * flat:.3g} mm, is too much for a"
                f" clip of {1e3 * self._params.length:.3g} mm for {1e3 * most:.3g} mm at most"
            )
        return ""

    def _spans(self, tube: _Caught, ends: Vector) -> bool:
        """Return whether a clip reaches across a flattened tube, with a slack of half its diameter."""
        closing = (ends[1] - ends[0]) / max(float(np.linalg.norm(ends[1] - ends[0])), 1e-9)
        aside = tube.offset - float((tube.offset * closing).sum()) * closing
        half = 0.25 * pi * tube.diameter
        return float(np.linalg.norm(aside)) + half <= 0.5 * self._params.length + 0.5 * tube.diameter

    def _warn(self, problem: str) -> None:
        warn_once(f"probe '{self._probe.name}': a clip slipped: {problem}")
