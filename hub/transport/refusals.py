"""Counts and logs refused messages: invalid, foreign or late."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

import zenoh

__all__ = ["Refusals"]

log = logging.getLogger(__name__)


class Refusals:
    """Counts refused messages by key, and logs the first messages of each key with their sender.

    A sender may make up keys without end: beyond some keys, all share a count.

    May be used from any thread. `report` is called with the key of each refused message.
    """

    _LOGGED_PER_KEY = 3
    _MOST_KEYS = 1000

    def __init__(self, report: Callable[[str], object] | None = None) -> None:
        self.by_key: dict[str, int] = {}
        self._report = report
        self._lock = threading.Lock()

    @property
    def total(self) -> int:
        """The number of refused messages."""
        return sum(self.by_key.values())

    def add(self, key: str) -> int:
        """Count a refusal on `key`; return the count of this key."""
        with self._lock:
            if len(self.by_key) >= self._MOST_KEYS and key not in self.by_key:
                key = "further keys"
            n = self.by_key[key] = self.by_key.get(key, 0) + 1
        if self._report is not None:
            self._report(key)
        return n

    def refuse(self, key: str, reason: object, sender: str = "") -> None:
        """Count a refused message, and log the reason and the sender."""
        n = self.add(key)
        if n <= self._LOGGED_PER_KEY:
            more = "; further ones on this key are only counted" if n == self._LOGGED_PER_KEY else ""
            log.warning("dropped a message on %s%s: %s%s", key, sender, reason, more)

    def refuse_sample(self, sample: zenoh.Sample, reason: object) -> None:
        """Refuse a sample."""
        source = sample.source_info
        sender = f" from {source.source_id.zid}" if source is not None else ""
        self.refuse(str(sample.key_expr), reason, sender)
