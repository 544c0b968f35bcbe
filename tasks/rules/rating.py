"""Rating scales of observers: the marks need an observer; the numbers of the card that bear on each item.

A mark from 1 to 5 is an expert's judgement. No rule that turns numbers into marks has been published with
enough cases, so none is made up: each mark is missing, with the metrics that its anchors speak of.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

from hub.participant import Record
from schemas.trocar_msgs import ScoreValue
from tasks.events import Event
from tasks.instant import Instant
from tasks.rules.rules import Rules, Setting

__all__ = ["Gears", "GoalsScale", "Osats"]

_NOBODY = "an observer's mark; no metric: "
_MARK = "an observer's mark, 1 to 5; measured instead: "
_DEPTH = "clips_slipped, errors/clip_not_across, tool_collisions"
_HANDS = "both_hands_share, PSM2/holding_time, hand_overs"
_EFFICIENCY = "trial_time, path_length, economy, idle_share, spectral_arc_length"
_TISSUE = "torn, perforations, avulsions, peak_pull, peak_force, grasps_torn_off, burnt, blood_lost"


class RatingState(Record):
    """Nothing: the metrics have all."""


class _Rating(Rules[RatingState]):
    """Items of a scale, each with the metrics that speak of it, or why there are none."""

    _items: ClassVar[Mapping[str, str]]

    def __init__(self, setting: Setting) -> None:  # noqa: ARG002
        self.state = RatingState()

    def update(self, now: Instant, events: Sequence[Event]) -> None:
        """Do nothing: the metrics take all."""

    def values(self, metrics: Mapping[str, ScoreValue]) -> Iterator[ScoreValue]:  # noqa: ARG002
        """Yield the items, without marks."""
        for item, about in self._items.items():
            yield ScoreValue(name=item, reason=about if about.startswith(_NOBODY) else _MARK + about)


class GoalsScale(_Rating):
    """GOALS: five items of 1 to 5 (Vassiliou et al., Am. J. Surg. 190, 2005)."""

    name: ClassVar[str] = "goals"
    _items: ClassVar[Mapping[str, str]] = {
        "depth_perception": _DEPTH,
        "bimanual_dexterity": _HANDS,
        "efficiency": _EFFICIENCY,
        "tissue_handling": _TISSUE,
        "autonomy": f"{_NOBODY}nobody helps or prompts in a session",
    }


class Gears(_Rating):
    """GEARS: six items of 1 to 5 (Goh et al., J. Urol. 187, 2012)."""

    name: ClassVar[str] = "gears"
    _items: ClassVar[Mapping[str, str]] = {
        "depth_perception": _DEPTH,
        "bimanual_dexterity": _HANDS,
        "efficiency": _EFFICIENCY,
        "force_sensitivity": _TISSUE,
        "robotic_control": "camera_moves, clutch_count, out_of_view_time, tool_collisions",
        "autonomy": f"{_NOBODY}nobody helps or prompts in a session",
    }


class Osats(_Rating):
    """OSATS, global rating: seven items of 1 to 5 (Martin et al., Br. J. Surg. 84, 1997)."""

    name: ClassVar[str] = "osats"
    _items: ClassVar[Mapping[str, str]] = {
        "respect_for_tissue": _TISSUE,
        "time_and_motion": _EFFICIENCY,
        "instrument_handling": "spectral_arc_length, normalised_jerk, tool_collisions, idle_energy",
        "knowledge_of_instruments": "errors/clip_slipped, blind_activations, errors/exchanged_while_holding",
        "use_of_assistants": f"{_NOBODY}the scene has no assistant to be told what to do",
        "flow_of_operation": "goal/..., phase/..., idle_share, camera_moves",
        "knowledge_of_procedure": "cvs/met_at_first_clip, errors/clipped_after_cut, errors/cut_without_clip",
    }
