"""Clips and cuts on cystic duct and cystic artery: where along the tube, and whether at the right places."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from hub.participant import Record, array, integer, number
from schemas.trocar_msgs import TubeEvent
from schemas.vectors import Vector
from tasks.cholecystectomy.organs import DUCT, ORGANS, TUBES
from tasks.cholecystectomy.params import CholecystectomyParams
from tasks.cholecystectomy.tissue_seen import OrganSeen
from tasks.events import Event

__all__ = ["TubeWatch"]

_MOST_CLIPS, _MOST_CUTS = 32, 4
_NUMBER, _ALONG, _TILT, _WIDTH = range(4)
_UNKNOWN = -1.0

Axis = Callable[[int], Vector]
"""Direction in which an arm's tip points, in `world`, shape (3,)."""


class TubeState(Record):
    """Clips and cuts of a tube."""

    clips = array(_MOST_CLIPS, 4)
    """Number, distance from the left end, m, deviation from square, rad (-1: unknown), and width, m, of each
    closed clip.
    """
    count = integer()
    """Number of closed clips."""
    length = number(_UNKNOWN)
    """Length at rest, m."""
    cuts = array(_MOST_CUTS)
    """Places of partings: distances from the left end, m."""
    cut_count = integer()
    cuffs = array(2)
    """Tissue between the first cut and the next clips towards gallbladder and patient, m; -1: no clip."""
    stays = integer()
    """Number of clips on the patient's side at the first cut."""
    slipped = integer()
    pulled_off = integer()


class TubeWatch:
    """Makes events of the clips and cuts of a tube whose left end is at the gallbladder."""

    def __init__(self, name: str, params: CholecystectomyParams, axis: Axis) -> None:
        self.state = TubeState()
        self.state.cuffs[:] = _UNKNOWN
        self.name, self._params, self._axis = name, params, axis
        self._place = ORGANS.index(name)
        self._nouns = ("duct clipped", "duct cut") if name == DUCT else ("artery clipped", "artery cut")

    @property
    def most_told(self) -> int:
        """Number of clips on the card."""
        return self._params.clips

    @property
    def clips(self) -> Vector:
        """Places of the closed clips in ascending order: distances from the gallbladder's end, m."""
        return np.sort(self.state.clips[: self.state.count, _ALONG])

    @property
    def tilts(self) -> Vector:
        """Known deviations of the closed clips from square, rad."""
        found = self.state.clips[: self.state.count, _TILT]
        return found[found >= 0.0]

    def observe(self, organ: OrganSeen, arm_of: Callable[[str], int]) -> Iterator[Event]:
        """Yield the events of an instant."""
        state = self.state
        if organ.tube is not None and state.length < 0.0:
            state.length = organ.tube.length
        widths = [event.size for event in organ.events if event.kind == "clipped"]
        for event in organ.tube_events:
            arm = arm_of(event.instrument)
            if event.kind == "clipped":
                yield from self._clip(organ, event, arm, widths[0] if widths else 0.0)
            elif event.kind == "clip pulled off":
                self._lose(event.clip)
                yield Event("clip pulled off", arm=arm, place=self._place)
            elif event.kind == "parted":
                yield from self._part(event, arm)
            elif event.kind in ("clip slipped", "clip not across"):
                state.slipped += 1
                kind = "clip slipped" if event.kind == "clip slipped" else "clip not across"
                yield Event(kind, arm=arm, place=self._place)
        for event in organ.events:
            if event.kind == "torn":
                arm = arm_of(event.instrument)
                yield Event("tube torn", arm=arm, place=self._place, value=event.size, unit=event.unit)

    def _clip(self, organ: OrganSeen, event: TubeEvent, arm: int, width: float) -> Iterator[Event]:
        state, params, along = self.state, self._params, event.along_m
        if state.count >= _MOST_CLIPS:
            return
        before, tilt = self.clips, self._tilt(organ, event, arm)
        state.clips[state.count] = event.clip, along, tilt, width
        state.count += 1
        yield Event("clip closed", arm=arm, place=self._place, value=along, unit="m")
        if state.cut_count:
            yield Event("clipped after cut", arm=arm, place=self._place)
        if set(event.others).intersection(TUBES):
            yield Event("clip across two", arm=arm, place=self._place)
        apart = float(np.abs(before - along).min(initial=np.inf))
        stump = state.length - along if state.length >= 0.0 else np.inf
        if apart < params.clip_distance or stump < params.stump:
            yield Event("clip too near", arm=arm, place=self._place, value=min(apart, stump), unit="m")
        if tilt > params.tilt:
            yield Event("clip oblique", arm=arm, place=self._place, value=tilt, unit="rad")
        if state.count == params.clips:
            yield Event(self._nouns[0], arm=arm, place=self._place)

    def _tilt(self, organ: OrganSeen, event: TubeEvent, arm: int) -> float:
        """Return the deviation of a clip from square, rad; -1: unknown."""
        if organ.tube is None or arm < 0:
            return _UNKNOWN
        at = np.array([event.position.x, event.position.y, event.position.z])
        along_legs = abs(float((self._axis(arm) * organ.tube.place(at).direction).sum()))
        return float(np.arcsin(min(1.0, along_legs)))

    def _lose(self, clip: int) -> None:
        """Take away a clip by its number."""
        state = self.state
        state.pulled_off += 1
        rows = np.flatnonzero(state.clips[: state.count, _NUMBER] == clip)
        if rows.size:
            last = state.count - 1
            state.clips[rows[0]] = state.clips[last]
            state.clips[last], state.count = 0.0, last

    def _part(self, event: TubeEvent, arm: int) -> Iterator[Event]:
        """Take a parting, and see whether it is a good cut."""
        state = self.state
        if state.cut_count < _MOST_CUTS:
            state.cuts[state.cut_count] = event.along_m
            state.cut_count += 1
        if event.cause not in ("cut", "burnt"):
            yield Event("tube torn", arm=arm, place=self._place)
        elif state.cut_count == 1:
            yield Event(self._nouns[1], arm=arm, place=self._place, value=event.along_m, unit="m")
            yield from self._judge(event.along_m, arm)

    def _judge(self, cut: float, arm: int) -> Iterator[Event]:
        """Compare the first cut with the clips on both sides."""
        state, clips = self.state, self.clips
        specimen, patient = clips[clips < cut], clips[clips >= cut]
        half = 0.5 * float(state.clips[: state.count, _WIDTH].max(initial=0.0))
        state.stays = len(patient)
        if specimen.size:
            state.cuffs[0] = max(0.0, cut - float(specimen[-1]) - half)
        if patient.size:
            state.cuffs[1] = max(0.0, float(patient[0]) - cut - half)
        if not clips.size:
            yield Event("cut without clip", arm=arm, place=self._place)
        elif not (specimen.size and patient.size):
            yield Event("cut beside clips", arm=arm, place=self._place, value=cut, unit="m")
        elif len(patient) < self._params.stays or len(clips) < self._params.clips:
            yield Event("cut with too few clips", arm=arm, place=self._place, value=float(len(patient)))
        known = state.cuffs[state.cuffs >= 0.0]
        if known.size and float(known.min()) < self._params.cuff:
            yield Event("cut with short cuff", arm=arm, place=self._place, value=float(known.min()), unit="m")
