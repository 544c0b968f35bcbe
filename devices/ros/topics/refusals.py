"""Says on an arm's `error` and `warning` why something was not heeded: at once, and the same not again for
two seconds.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from time import monotonic_ns

from devices.ros.topics.row import Row
from schemas.ros import StringMessage

__all__ = ["Refusals"]

log = logging.getLogger(__name__)

_REPEAT_NS = 2_000_000_000
"""Before the same is told again (jhu-dvrk/sawIntuitiveResearchKit, mtsIntuitiveResearchKitArm.cpp,
ArmIsReady).
"""
_MOST = 8
"""Different things told of one topic within that time; a client that goes wrong in ever new ways is not
quoted for ever.
"""


class Refusals:
    """What was told lately, and how often it was left untold since then."""

    def __init__(self, name: str, say: Callable[[str, StringMessage], None]) -> None:
        """Take the gateway's name, and what publishes a text on a port such as `PSM1/warning`, if there is
        one.
        """
        self._name, self._say = name, say
        self._lately: dict[str, dict[str, tuple[int, int]]] = {}
        self._telling = threading.Lock()

    def tell(self, row: Row, level: str, reason: str) -> None:
        """Tell on `<owner>/<level>` (`error`: it cannot be, `warning`: not now) why a message on `row` was
        refused.
        """
        with self._telling:
            untold = self._untold(row, f"{level} {reason}")
        if untold < 0:
            return
        text = f"{row.name} refused: {reason}" + (f" ({untold + 1} times)" if untold else "")
        log.warning("device '%s': %s: %s", self._name, row.owner, text)
        self._say(f"{row.owner}/{level}", StringMessage(data=f"{row.owner}: {text}"))

    def _untold(self, row: Row, words: str) -> int:
        """Return how often the same was left untold since it was told last; -1 if it is too early to tell it
        again.
        """
        now_ns, lately = monotonic_ns(), self._lately.setdefault(row.topic, {})
        told_ns, count = lately.get(words, (now_ns - _REPEAT_NS, 0))
        if now_ns - told_ns < _REPEAT_NS:
            lately[words] = told_ns, count + 1
            return -1
        if words not in lately:
            for old in [w for w, (ns, _) in lately.items() if now_ns - ns >= _REPEAT_NS]:
                del lately[old]
            if len(lately) >= _MOST:
                return -1
        lately[words] = now_ns, 0
        return count
