"""Counts and logs messages that are refused."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

import zenoh

__all__ = ["Refusals"]

log = logging.getLogger(__name__)


class Refusals:
    """Counts what was refused, per key, and logs each key's first refusals with their source. For use from
    any thread.
    """

    _LOGGED_PER_KEY = 3

    def __init__(self, tell: Callable[[str], object] | None = None) -> None:
        """`tell` gets the key of each message that is refused."""
        self.by_key: dict[str, int] = {}
        self._tell = tell
        self._lock = threading.Lock()

    @property
    def total(self) -> int:
        """How many messages were refused."""
        return sum(self.by_key.values())

    def add(self, key: str) -> int:
        """Count one refusal on `key`; return how many there are by now."""
        with self._lock:
            n = self.by_key[key] = self.by_key.get(key, 0) + 1
        if self._tell is not None:
            self._tell(key)
        return n

    def refuse(self, key: str, reason: object, sender: str = "") -> None:
        """Count a refused message, and say why and where it came from."""
        n = self.add(key)
        if n <= self._LOGGED_PER_KEY:
            more = "; further ones on this key are only counted" if n == self._LOGGED_PER_KEY else ""
            log.warning("dropped a message on %s%s: %s%s", key, sender, reason, more)

    def count(self, sample: zenoh.Sample, reason: object) -> None:
        """Refuse a sample."""
        source = sample.source_info
        self.refuse(
            str(sample.key_expr), reason, f" from {source.source_id.zid}" if source is not None else ""
        )
