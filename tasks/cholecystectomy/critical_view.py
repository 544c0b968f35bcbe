"""The critical view of safety, measured in the state (Strasberg and Brunt 2010).

Two and only two structures enter the gallbladder; the hepatocystic triangle is cleared of fat; the lower
third of the gallbladder is freed from the cystic plate.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from hub.participant import Record, array, number
from schemas.trocar_msgs import ScoreValue
from tasks.cholecystectomy.organs import FAT_BEDS, GALLBLADDER, ORGANS, PLATE, TARGETS
from tasks.cholecystectomy.tissue_seen import TissueSeen
from tasks.cholecystectomy.tubes import TubeWatch
from tasks.cholecystectomy.watch import Watch, value_or_reason
from tasks.events import Event

__all__ = ["CLEARED", "CriticalView"]

CLEARED = 0.9
"""Share of fat, or of the lower third of the plate, that counts as all; ours."""
_FREED = 0.99
"""Share of the whole plate that counts as all; ours."""
_NO_PLATE = f"no cystic plate with a `lower_end`: connect or record tissue/{PLATE}/lower_third"
_NO_TRIANGLE = f"not known: connect tissue/<organ>/line of the tubes and tissue/{FAT_BEDS[0]}/*"


class CriticalViewState(Record):
    """Shares at the last instant, and at the first clip."""

    structures = number()
    """Number of whole tubes between gallbladder and patient."""
    cleared = number()
    """Share of the fat over the triangle that has come off."""
    plate = number()
    """Share of the lower third of the plate that is free."""
    freed = number()
    """Share of the whole plate that is free."""
    at_clip = number(-1.0)
    """Number of criteria that were met at the first clip; -1: no clip yet."""
    view = array(3)
    """Structures, and shares of fat and plate, now or, once there is a clip, at the first one."""


class CriticalView(Watch[CriticalViewState]):
    """The three criteria, and how many of them were met when the first clip was closed."""

    def __init__(self, seen: TissueSeen, tubes: Sequence[TubeWatch]) -> None:
        self.state = CriticalViewState()
        self._seen, self._tubes = seen, tubes

    @property
    def has_tubes(self) -> bool:
        """Whether both tubes are in the scene, with their lines."""
        return all(self._seen.organs[name].has_line for name in TARGETS)

    @property
    def is_freed(self) -> bool:
        """Whether the gallbladder is off the liver."""
        return self.state.freed >= _FREED

    @property
    def met(self) -> int:
        """Number of criteria that are met."""
        state = self.state
        return int(state.structures == len(TARGETS)) + (state.cleared >= CLEARED) + (state.plate >= CLEARED)

    def observe(self, *, is_clipped: bool) -> Iterator[Event]:
        """Take the shares of an instant; yield the events. `is_clipped`: the instant has the first clip."""
        state, before, was_freed = self.state, (self.state.cleared, self.state.plate), self.is_freed
        state.structures = float(self.has_tubes * sum(not tube.state.cut_count for tube in self._tubes))
        state.cleared, state.plate = self._seen.triangle_cleared or 0.0, self._seen.plate_freed or 0.0
        if before[0] < CLEARED <= state.cleared:
            yield Event("triangle cleared", value=state.cleared)
        if before[1] < CLEARED <= state.plate:
            yield Event("plate opened", value=state.plate)
        state.freed = self._seen.shares.get(PLATE, 0.0)
        if self.is_freed and not was_freed:
            yield Event("gallbladder freed", place=ORGANS.index(GALLBLADDER), value=state.freed)
        if state.at_clip < 0.0:
            state.view[:] = state.structures, state.cleared, state.plate
            state.at_clip = float(self.met) if is_clipped else state.at_clip

    def values(self) -> Iterator[ScoreValue]:
        """Yield structures and shares up to the first clip, and the number of criteria met there."""
        state, seen = self.state, self._seen
        structures, cleared, plate = state.view.tolist()
        reason = "" if self.has_tubes else "no lines of cystic duct and artery: connect tissue/<organ>/line"
        yield value_or_reason("cvs/structures", structures, "", reason)
        reason = "" if seen.triangle_cleared is not None else _NO_TRIANGLE
        yield value_or_reason("cvs/triangle_cleared", cleared, "", reason)
        reason = "" if seen.plate_freed is not None else _NO_PLATE
        yield value_or_reason("cvs/plate_freed", plate, "", reason)
        reason = "" if PLATE in seen.shares else _NO_PLATE
        yield value_or_reason("plate_freed", state.freed, "", reason)
        reason = "" if state.at_clip >= 0.0 else "nothing has been clipped yet"
        yield value_or_reason("cvs/met_at_first_clip", state.at_clip, "", reason)
