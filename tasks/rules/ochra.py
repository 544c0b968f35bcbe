"""Errors by mode, as observational clinical human reliability analysis counts them.

Source: Tang, Hanna, Joice and Cuschieri, Arch. Surg. 139 (2004): 200 cholecystectomies with 11.0 (standard
deviation 8.0) errors each, 4.0 (3.0) of them consequential. Raters also see hesitation, blind and groping
moves; a state does not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

from hub.participant import Record, array, number
from schemas.trocar_msgs import ScoreValue
from tasks.events import Event
from tasks.instant import Instant
from tasks.rules.operation_errors import ERRORS, MODES, NO_OPERATION
from tasks.rules.rules import Rules, Setting

__all__ = ["Ochra"]


class OchraState(Record):
    """Counts."""

    modes = array(len(MODES))
    consequential = number()
    total = number()


class Ochra(Rules[OchraState]):
    """Number of errors of each mode."""

    name: ClassVar[str] = "ochra"

    def __init__(self, setting: Setting) -> None:  # noqa: ARG002
        self.state = OchraState()
        self._modes = list(MODES)

    def update(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """Count errors."""
        for event in events:
            if (error := ERRORS.get(event.kind)) is not None:
                self.state.modes[self._modes.index(error.mode)] += 1.0
                self.state.consequential += error.is_consequential
                self.state.total += 1.0

    def values(self, metrics: Mapping[str, ScoreValue]) -> Iterator[ScoreValue]:
        """Yield the counts, in all, with consequences, and by mode."""
        reason = "" if "cvs/structures" in metrics else NO_OPERATION
        state = self.state
        yield ScoreValue(name="errors", value=state.total, reason=reason)
        yield ScoreValue(name="consequential", value=state.consequential, reason=reason)
        yield ScoreValue(name="inconsequential", value=state.total - state.consequential, reason=reason)
        for (mode, why), count in zip(MODES.items(), state.modes.tolist(), strict=True):
            yield ScoreValue(name=mode, value=count, reason=reason or why)
