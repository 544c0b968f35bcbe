"""The page of a single session after the end: the recording, until the last page has gone."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from time import monotonic

from hub.recording.recording import Recording
from schemas.errors import CutShortError, TrocarError
from webconsole.console import Console
from webconsole.live import Live
from webconsole.open_recording import open_recording
from webconsole.recorded import Recorded

__all__ = ["Afterlife"]

log = logging.getLogger(__name__)

_LOOK_S = 0.2
_LEFT_S = 60.0
"""Time without a page until the server ends: to load a page again takes seconds."""
_CLOSING_S = 30.0
"""Time for the hub to close its recording after the last step."""


class Afterlife:
    """Shows the recording of a session that has ended, and ends the server when nobody looks any more.

    Args:
        console: Contents of the pages.
        stack: Closes the recording.
    """

    def __init__(self, console: Console, stack: ExitStack) -> None:
        self._console, self._stack = console, stack

    async def run(self, pages: Callable[[], int], stop: Callable[[], None]) -> None:
        """Wait for the end of the session, and for that of the last page.

        Args:
            pages: Returns the number of open pages.
            stop: Ends the server.
        """
        live, begun_s = self._console.live_source(), monotonic()
        while not live.is_over:
            if live.scenario is None and monotonic() - begun_s > _LEFT_S:
                break  # the hub has gone before it was found
            await asyncio.sleep(_LOOK_S)
        if pages():
            await self._show_recording(live)
            await self._wait_for_last(pages)
        stop()

    async def _show_recording(self, live: Live) -> None:
        """Let the pages show the recording; without one they keep the last values of the session."""
        if live.past is None:
            return
        try:
            recorded = await self._open(Path(live.recording))
        except TrocarError as error:
            log.warning("the recording is not shown: %s", error)
            return
        self._console.show(recorded)
        await asyncio.to_thread(live.close)

    async def _open(self, recording: Path) -> Recorded:
        """Return the recording once the hub has closed it; of a hub that was killed, the whole part."""
        for _ in range(round(_CLOSING_S / _LOOK_S)):
            try:
                await asyncio.to_thread(Recording, recording)
                break
            except CutShortError:
                await asyncio.sleep(_LOOK_S)
        # it names the classes and files that this user's own session has just run
        return await asyncio.to_thread(open_recording, recording, self._stack, trust=True)

    async def _wait_for_last(self, pages: Callable[[], int]) -> None:
        seen_s = monotonic()
        while monotonic() - seen_s < _LEFT_S:
            if pages():
                seen_s = monotonic()
            await asyncio.sleep(_LOOK_S)
