"""A recording as the source of pages, also one that was cut short."""

from __future__ import annotations

import logging
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

from hub.recording.recover import recover
from schemas.errors import CutShortError
from webconsole.recorded import Recorded

__all__ = ["open_recording"]

log = logging.getLogger(__name__)


def open_recording(recording: Path, stack: ExitStack, *, trust: bool = False) -> Recorded:
    """Return a recording, open as long as `stack`; of a truncated recording, the whole part."""
    try:
        return Recorded(recording, trust=trust)
    except CutShortError:
        whole = Path(stack.enter_context(TemporaryDirectory()), recording.stem)
        saved = recover(recording, whole)
        log.warning("'%s' was cut short: it is shown up to %g s", recording, saved.end_ns / 1e9)
        return Recorded(whole, trust=trust)
