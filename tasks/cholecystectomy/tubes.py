"""Clips and cuts on cystic duct and cystic artery: where along the tube, and whether at the right places."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from hub.participant import Record, array, integer, number
from schemas.trocar_msgs import TissueEvent
from schemas.vectors import Vector
from tasks.cholecystectomy.organs import DUCT, ORGANS
from tasks.cholecystectomy.params import CholecystectomyParams
from tasks.cholecystectomy.tissue_seen import OrganSeen
from tasks.events import Event
from tasks.instant import Instant

__all__ = ["TubeWatch"]

_MOST_CLIPS, _MOST_CUTS = 32, 4
_ALONG, _TILT, _WIDTH = range(3)
_UNKNOWN = -1.0
_CUT_WINDOW = 0.5
"""Time after the last sweep of an edge within which a parting is a cut, s; else the tube has torn."""
_BURNT_THROUGH = 90.0
"""Temperature at which a parting is a cut by heat, degrees C."""
_NEAR_JOINT = 1e-3
"""Slack of a clip's distance from the end of a tube, m."""

Axis = Callable[[int], Vector]
"""Direction in which an arm's tip points, in `world`, shape (3,)."""


class TubeState(Record):
    """Clips and cuts of a tube."""

    clips = array(_MOST_CLIPS, 3)
    """Distance from the left end, m, deviation from square, rad (-1: unknown), and width, m, of each clip."""
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
    area = number()
    """Area swept by edges, m^2."""
    swept_at = number(-1.0)
    """Time of the last sweep of an edge, s."""
    slipped = integer()
    pulled_off = integer()
    tears = integer()


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

    def observe(self, organ: OrganSeen, arm_of: Callable[[str], int], now: Instant) -> Iterator[Event]:
        """Yield the events of an instant."""
        state = self.state
        if organ.tube is not None and state.length < 0.0:
            state.length = organ.tube.length
        if organ.cut_area > state.area:
            state.area, state.swept_at = organ.cut_area, now.time_s
        yield from self._part(organ, now)
        for event in organ.events:
            arm = arm_of(event.instrument)
            if event.kind == "clipped":
                yield from self._clip(organ, event, arm)
            elif event.kind in ("clip slipped", "clip not across"):
                state.slipped += 1
                kind = "clip slipped" if event.kind == "clip slipped" else "clip not across"
                yield Event(kind, arm=arm, place=self._place, value=event.size, unit=event.unit)
            elif event.kind == "clip pulled off":
                self._lose(organ, event)
                yield Event("clip pulled off", place=self._place, value=event.size, unit=event.unit)
            elif event.kind == "torn":
                state.tears += 1
                yield Event("tube torn", arm=arm, place=self._place, value=event.size, unit=event.unit)

    def _clip(self, organ: OrganSeen, event: TissueEvent, arm: int) -> Iterator[Event]:
        state, params = self.state, self._params
        if state.count >= _MOST_CLIPS:
            return
        row, before = state.count, self.clips
        state.clips[row], state.count = (_UNKNOWN, _UNKNOWN, event.size), row + 1
        along, tilt = self._measure(organ, event, arm)
        state.clips[row, :2] = along, tilt
        yield Event("clip closed", arm=arm, place=self._place, value=max(along, 0.0), unit="m")
        if state.cut_count:
            yield Event("clipped after cut", arm=arm, place=self._place)
        apart = float(np.abs(before - along).min()) if before.size and along >= 0.0 else np.inf
        stump = state.length - along + _NEAR_JOINT if along >= 0.0 else np.inf
        if apart < params.clip_distance or stump < params.stump:
            yield Event("clip too near", arm=arm, place=self._place, value=min(apart, stump), unit="m")
        if tilt > params.tilt:
            yield Event("clip oblique", arm=arm, place=self._place, value=tilt, unit="rad")
        if state.count == params.clips:
            yield Event(self._nouns[0], arm=arm, place=self._place)

    def _measure(self, organ: OrganSeen, event: TissueEvent, arm: int) -> tuple[float, float]:
        """Return the place of a clip along the tube, m, and its deviation from square, rad; -1: unknown."""
        if organ.tube is None:
            return _UNKNOWN, _UNKNOWN
        place = organ.tube.place(_position(event))
        if arm < 0:
            return place.along, _UNKNOWN
        along_legs = abs(float((self._axis(arm) * place.direction).sum()))
        return place.along, float(np.arcsin(min(1.0, along_legs)))

    def _lose(self, organ: OrganSeen, event: TissueEvent) -> None:
        """Take away the clip nearest to the place of an event."""
        state = self.state
        state.pulled_off += 1
        if not state.count:
            return
        along = state.clips[: state.count, _ALONG]
        place = 0.0 if organ.tube is None else organ.tube.place(_position(event)).along
        row, last = int(np.abs(along - place).argmin()), state.count - 1
        state.clips[row] = state.clips[last]
        state.clips[last], state.count = 0.0, last

    def _part(self, organ: OrganSeen, now: Instant) -> Iterator[Event]:
        """See whether the tube has been parted, and how."""
        state = self.state
        partings = [] if organ.tube is None else organ.tube.partings[:_MOST_CUTS]
        if len(partings) <= state.cut_count:
            return
        known = state.cuts[: state.cut_count]
        fresh = [one for one in partings if not known.size or np.abs(known - one).min() > _NEAR_JOINT]
        state.cut_count = len(partings)
        state.cuts[: len(partings)] = partings
        is_cut = now.time_s - state.swept_at <= _CUT_WINDOW and state.swept_at >= 0.0
        if not is_cut and organ.hottest < _BURNT_THROUGH:
            state.tears += 1
            yield Event("tube torn", place=self._place)
            return
        if known.size or not fresh:
            return
        yield Event(self._nouns[1], place=self._place, value=fresh[0], unit="m")
        yield from self._judge(fresh[0])

    def _judge(self, cut: float) -> Iterator[Event]:
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
            yield Event("cut without clip", place=self._place)
        elif not (specimen.size and patient.size):
            yield Event("cut beside clips", place=self._place, value=cut, unit="m")
        elif len(patient) < self._params.stays or len(clips) < self._params.clips:
            yield Event("cut with too few clips", place=self._place, value=float(len(patient)))
        known = state.cuffs[state.cuffs >= 0.0]
        if known.size and float(known.min()) < self._params.cuff:
            yield Event("cut with short cuff", place=self._place, value=float(known.min()), unit="m")


def _position(event: TissueEvent) -> Vector:
    return np.array([event.position.x, event.position.y, event.position.z])
