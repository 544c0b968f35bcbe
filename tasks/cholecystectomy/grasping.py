"""Grasps of tissue: how often, how long, how strong, and how often tissue was lost."""

from __future__ import annotations

from collections.abc import Iterator

from hub.participant import Record, array
from schemas.trocar_msgs import ScoreValue
from tasks.cholecystectomy.organs import GALLBLADDER, ORGANS
from tasks.cholecystectomy.tissue_seen import TissueSeen
from tasks.cholecystectomy.watch import Watch, value_or_reason
from tasks.events import Event
from tasks.instant import Instant

__all__ = ["Grasping"]


class GraspingState(Record):
    """Sums of each arm."""

    grasps = array("arms")
    torn = array("arms")
    """Number of grasps that ended because the pull was too strong."""
    time = array("arms")
    """Time with tissue in the jaws, s."""
    pull = array("arms")
    """Largest pull, N."""
    exchanges = array("arms")
    """Number of exchanges of the instrument."""


class Grasping(Watch[GraspingState]):
    """Counts, times and pulls of each arm; also makes the events about grasps."""

    def __init__(self, seen: TissueSeen) -> None:
        self.state = GraspingState(arms=len(seen.arms))
        self._seen = seen

    def observe(self, now: Instant) -> Iterator[Event]:
        """Add a period; yield the events of an instant."""
        state = self.state
        for i, arm in enumerate(self._seen.arms):
            state.time[i] += now.period_s * arm.held
            state.pull[i] = max(float(state.pull[i]), arm.pull)
            state.exchanges[i] += arm.exchanges
            kinds = {grasp.event for grasp in arm.grasps}
            # as commanded, else as the tissue tells
            if arm.exchanges and arm.held if arm.can_exchange else "exchanged while holding" in kinds:
                yield Event("exchanged while holding", arm=i)
            state.grasps[i] += "grasped" in kinds  # a grasp of two organs is one
            state.torn[i] += "torn" in kinds
            for grasp in arm.grasps:
                place = ORGANS.index(grasp.body) if grasp.body in ORGANS else -1
                if grasp.event == "grasped" and grasp.body == GALLBLADDER:
                    yield Event("gallbladder grasped", arm=i, place=place)
                elif grasp.event == "torn":
                    yield Event("grasp torn off", arm=i, place=place, value=grasp.force_n, unit="N")

    def values(self) -> Iterator[ScoreValue]:
        """Yield counts, times (s) and pulls (N) of each arm."""
        rows = (
            ("tissue_grasps", self.state.grasps, ""),
            ("grasps_torn_off", self.state.torn, ""),
            ("holding_time", self.state.time, "s"),
            ("peak_pull", self.state.pull, "N"),
        )
        for name, values, unit in rows:
            for arm, value in zip(self._seen.arms, values.tolist(), strict=True):
                full = f"{arm.name}/{name}"
                reason = (
                    f"no grasp of tissue: connect or record tissue/{arm.name}/held of a probe with `grasp`"
                )
                yield value_or_reason(full, value, unit, "" if arm.has_grasp else reason)
        for arm, value in zip(self._seen.arms, self.state.exchanges.tolist(), strict=True):
            reason = f"no commands: connect or record {arm.name}/set_tool_type"
            yield value_or_reason(f"{arm.name}/exchanges", value, "", "" if arm.can_exchange else reason)
