"""Numbers of the card about the clips and cuts of a tube."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from schemas.trocar_msgs import ScoreValue
from tasks.cholecystectomy.organs import DUCT
from tasks.cholecystectomy.tissue_seen import OrganSeen
from tasks.cholecystectomy.tubes import TubeState, TubeWatch
from tasks.cholecystectomy.watch import Watch, value_or_reason

__all__ = ["TubeMetrics"]


class TubeMetrics(Watch[TubeState]):
    """Clips: number, place, distance, tilt. Cuts: place, clips that stay, cuffs."""

    def __init__(self, watch: TubeWatch, organ: OrganSeen) -> None:
        self.state, self._watch, self._organ = watch.state, watch, organ
        self._word = "duct" if watch.name == DUCT else "artery"

    def values(self) -> Iterator[ScoreValue]:
        """Yield counts, distances (m) and tilt (rad)."""
        state, organ = self.state, self._organ
        reason = "" if organ.is_known else f"no such organ: connect or record tissue/{organ.name}/events"
        for name, value in (
            ("clips", state.count),
            ("clips_slipped", state.slipped),
            ("clips_pulled_off", state.pulled_off),
            ("cuts", state.cut_count),
        ):
            yield value_or_reason(f"{self._word}/{name}", float(value), "", reason)
        if not organ.has_line:
            reason = reason or f"no line of the tube: connect or record tissue/{organ.name}/line"
        yield from self._clips(reason)
        yield from self._cut(reason)

    def _clips(self, reason: str) -> Iterator[ScoreValue]:
        places, tilts, length = self._watch.clips, self._watch.tilts, self.state.length
        for number in range(self._watch.most_told):
            known = number < len(places)
            along = float(places[number]) if known else 0.0
            why = reason or ("" if known else "there is no such clip")
            yield value_or_reason(f"{self._word}/clip{number + 1}_from_gallbladder", along, "m", why)
        why = reason or ("" if len(places) > 1 else "there are fewer than two clips")
        apart = float(np.diff(places).min(initial=np.inf)) if not why else 0.0
        yield value_or_reason(f"{self._word}/clip_distance", apart, "m", why)
        why = reason or ("" if len(places) else "there is no clip")
        stump = length - float(places[-1]) if not why else 0.0
        other = "common_duct" if self._word == "duct" else "origin"
        yield value_or_reason(f"{self._word}/distance_from_{other}", stump, "m", why)
        why = reason or ("" if len(tilts) else "no clip was closed by an arm of the scene")
        yield value_or_reason(f"{self._word}/clip_tilt", float(tilts.max(initial=0.0)), "rad", why)

    def _cut(self, reason: str) -> Iterator[ScoreValue]:
        state = self.state
        why = reason or ("" if state.cut_count else "the tube is whole")
        yield value_or_reason(f"{self._word}/cut_from_gallbladder", float(state.cuts[0]), "m", why)
        yield value_or_reason(f"{self._word}/clips_that_stay", float(state.stays), "", why)
        for side, cuff in zip(("gallbladder", "patient"), state.cuffs.tolist(), strict=True):
            none = why or ("" if cuff >= 0.0 else "there is no clip on this side of the cut")
            yield value_or_reason(f"{self._word}/cuff_{side}", cuff, "m", none)
