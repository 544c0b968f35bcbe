"""Reports on an arm's `error` and `warning` why a message was refused: at once, then every two seconds."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from time import monotonic_ns

from devices.ros.topics.row import Row
from robots.dvrk.crtk import REPEAT_NS
from schemas.ros import StringMessage

__all__ = ["RefusalReports"]

log = logging.getLogger(__name__)

_MOST = 8
"""Different texts reported of one topic within that time: a client may have a new error each time."""


class RefusalReports:
    """Reports refused messages, and counts those that are not reported; for use from any thread."""

    def __init__(self, name: str, publish: Callable[[str, StringMessage], None]) -> None:
        """`name`: the gateway's; `publish`: publishes a text on a port (`PSM1/warning`), if it exists."""
        self._name, self._publish = name, publish
        self._recent: dict[str, dict[str, tuple[int, int]]] = {}
        """By topic and text: when it was reported last (ns), and how often it was suppressed since."""
        self._counting = threading.Lock()

    def report(self, row: Row, level: str, reason: str) -> None:
        """Report on `<owner>/<level>` why a message on `row` was refused.

        `level`: `error` if the message is invalid, `warning` if it is not allowed now.
        """
        with self._counting:
            suppressed = self._suppressed(row, f"{level} {reason}")
        if suppressed is None:
            return
        text = f"{row.name} refused: {reason}" + (f" ({suppressed + 1} times)" if suppressed else "")
        log.warning("device '%s': %s: %s", self._name, row.owner, text)
        self._publish(f"{row.owner}/{level}", StringMessage(data=f"{row.owner}: {text}"))

    def _suppressed(self, row: Row, text: str) -> int | None:
        """Return how often the same text was suppressed since its last report; None to suppress it now."""
        now_ns, recent = monotonic_ns(), self._recent.setdefault(row.topic, {})
        reported_ns, count = recent.get(text, (now_ns - REPEAT_NS, 0))
        if now_ns - reported_ns < REPEAT_NS:
            recent[text] = reported_ns, count + 1
            return None
        if text not in recent:
            for old in [t for t, (ns, _) in recent.items() if now_ns - ns >= REPEAT_NS]:
                del recent[old]
            if len(recent) >= _MOST:
                return None
        recent[text] = now_ns, 0
        return count
