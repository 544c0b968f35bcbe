"""Warnings about a scene, given once in a process."""

from __future__ import annotations

import logging
from functools import lru_cache

__all__ = ["warn_once"]

_log = logging.getLogger(__name__)


@lru_cache(maxsize=64)
def warn_once(text: str) -> None:
    """Warn, but not again where the same scene is configured again, as for the next episode of learning."""
    _log.warning("%s", text)
