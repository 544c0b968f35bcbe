"""Reports on an arm's `error` and `warning` why a message was refused: at once, then every two seconds.

Every refused move is reported, as by the motion controller: a program waits for the answer.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from time import monotonic_ns

import numpy as np

from devices.ros.topics.row import Row
from hub.participant.token_bucket import TokenBucket
from robots.dvrk.crtk import is_move
from robots.dvrk.repeats import is_recent, refusals_to_report
from schemas.ros import StringMessage
from schemas.vectors import Vector

__all__ = ["RefusalReports"]

log = logging.getLogger(__name__)

_MOST = 8
"""Most different texts reported per topic within the period: a client may send a new error each time."""
_MOVES_PER_S, _MOVES_AT_ONCE = 50, 50
"""Limits of reports on equal refused moves, per gateway."""


class RefusalReports:
    """Reports refused messages, and counts unreported refusals; for use from any thread."""

    def __init__(self, name: str, publish: Callable[[str, StringMessage], None]) -> None:
        """`name`: the gateway's; `publish`: publishes a text on an existing port (`PSM1/warning`)."""
        self._name, self._publish = name, publish
        self._recent: dict[str, dict[str, Vector]] = {}
        """Last report of a refusal, in the form of `refusals_to_report`, by topic and words."""
        self._moves = TokenBucket(_MOVES_PER_S, _MOVES_AT_ONCE)
        self._counting = threading.Lock()

    def report(self, row: Row, level: str, reason: str) -> None:
        """Report on `<owner>/<level>` why a message on `row` was refused.

        `level`: `error` for an invalid message, `warning` for a message not allowed now.
        """
        with self._counting:
            count = self._to_report(row, f"{level} {reason}")
        if not count:
            return
        text = f"{row.name} refused: {reason}" + (f" ({count} times)" if count > 1 else "")
        log.warning("device '%s': %s: %s", self._name, row.owner, text)
        self._publish(f"{row.owner}/{level}", StringMessage(data=f"{row.owner}: {text}"))

    def _to_report(self, row: Row, words: str) -> int:
        """Return the number of equal refusals since the last report; 0: not to be reported now."""
        now_ns, recent = monotonic_ns(), self._recent.setdefault(row.topic, {})
        if words not in recent:
            for old in [one for one, last in recent.items() if not is_recent(last, now_ns)]:
                del recent[old]
            if len(recent) >= _MOST:
                return 0
            recent[words] = np.zeros(3)
        count = refusals_to_report(recent[words], words, now_ns)
        return count or int(is_move(row.name) and self._moves.spend(now_ns))
