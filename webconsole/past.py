"""The past of a running session: any instant of the session's recording, as far as written."""

from __future__ import annotations

import logging
from pathlib import Path

from hub.recording.bag import Bag
from hub.recording.moments import Moments
from schemas.errors import RecordingError
from webconsole.source import Value

__all__ = ["Past"]

log = logging.getLogger(__name__)


class Past:
    """Follows a recording under way; `look` runs in a single thread, `newest` in any.

    Args:
        path: The rosbag2 directory.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._moments: Moments | None = None
        self._bag: Bag | None = None
        self._failed = False
        self.span_ns: tuple[int, int] | None = None
        """Simulated time of the first and the last readable message; None before the first message."""

    def look(self) -> None:
        """Read the messages written since the last call; damage is logged once and not shown."""
        if self._failed:
            return
        try:
            if self._bag is None:
                self._bag = Bag(self._path, unfinished=True)
                self._moments = Moments(self._bag)
            else:
                self._bag.grow()
            if self._moments is not None and self._bag.chunks:
                self.span_ns = self._moments.span_ns
        except RecordingError as error:
            if self._bag is None:  # the session has only begun to write it
                log.debug("the past of the session cannot be shown yet: %s", error)
                return
            self._failed = True
            log.warning("the past of the session is not shown further: %s", error)

    def newest(self, topic: str, time_ns: int) -> Value | None:
        """Return the newest message of a topic up to a simulated time; None if none is written by then."""
        if self._bag is None or self._moments is None or topic not in self._bag.topics:
            return None
        found = self._moments.newest(topic, time_ns)
        return None if found is None else Value(found.time_ns, found.payload)
