"""Sessions started by an operator from a page: each a process of `trocar` with a separate page."""

from __future__ import annotations

import logging
import re
import subprocess
import threading
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from importlib.metadata import entry_points
from pathlib import Path
from time import sleep
from typing import Any

import zenoh

from hub.remote.hub_connection import is_listening, reach
from hub.security.credentials import OBSERVER
from hub.transport.hub_files import running_hubs
from schemas.codec import decode
from schemas.errors import ConnectError, MessageError
from schemas.keys import Keys
from schemas.scenario import Scenario
from schemas.trocar_msgs import SessionStatus
from webconsole.ready import END_S, ReadyProcess
from webconsole.stage import GROUP

__all__ = ["Started", "StartedSession", "new_recording_path", "page_devices"]

log = logging.getLogger(__name__)

_COMMAND = "hub.command_line.app"
_MOST = 4
"""Most sessions at once: each takes a core and more."""
_LOOK_S = 0.1
_PATIENCE_S = 5.0
_MOST_SAID = 4000
_PROMISED: set[Path] = set()
"""Directories of sessions that this server has started."""
_PAGE_DEVICE = "{kind: browser, host: remote}"
_LINK = re.compile(r"http://127\.0\.0\.1:\d+/\?token=[\w-]+")


class Ready:
    """The processes of a session to come, hub and page, waiting for their arguments.

    Args:
        modules: Imported by the hub's process meanwhile.
    """

    def __init__(self, modules: Sequence[str]) -> None:
        self.hub = ReadyProcess((_COMMAND, *modules))
        self.page = ReadyProcess((_COMMAND, "webconsole.serve", *_drawable_scenes()))

    def close(self) -> None:
        """Let both processes end."""
        self.hub.close()
        self.page.close()


def _drawable_scenes() -> list[str]:
    """Return the modules of a page's scenes."""
    return sorted({entry.module for entry in entry_points(group=GROUP)})


class StartedSession:
    """A session: the process of the hub, and the process of the page.

    Args:
        number: Number of the session, on pages.
        title: Title for people.
        arguments: Arguments of `trocar`, checked.
        live_from_s: Simulated time at which the session becomes live: before, a past is simulated again.
        ready: The processes, waiting for their arguments.
    """

    def __init__(
        self, number: int, title: str, arguments: Sequence[str], live_from_s: float, ready: Ready
    ) -> None:
        self.number, self.title, self.live_from_s = number, title, live_from_s
        self._ready = ready
        self.time_s = 0.0
        self.error = self.link = ""
        self._asked_to_end = False
        self._viewer: subprocess.Popen[bytes] | None = None
        self._hub = ready.hub.run(arguments)
        self._thread = threading.Thread(target=self._follow, name=f"session {number}", daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int:
        """The hub's process."""
        return self._hub.pid

    @property
    def ended(self) -> bool:
        """Whether the hub's process has ended."""
        return self._hub.poll() is not None

    def as_json(self) -> dict[str, Any]:
        """Return the session for pages: state, share of the past already simulated, and link."""
        live = bool(self.link) and self.time_s >= self.live_from_s
        over = not self._thread.is_alive()  # only then is it known whether it failed
        state = "failed" if self.error else "ended" if over else "live" if live else "starting"
        return {
            "number": self.number,
            "title": self.title,
            "state": state,
            "share": min(1.0, self.time_s / self.live_from_s) if self.live_from_s else float(live),
            "link": self.link if state == "live" else "",
            "error": self.error,
        }

    def end(self) -> None:
        """End the session as SIGTERM does; the recording is closed in order."""
        if not self.ended:
            self._asked_to_end = True
            self._hub.terminate()  # not SIGINT: a shell lets a server in the background ignore it

    def close(self) -> None:
        """End the session and wait for the end."""
        self.end()
        _wait(self._hub)
        self._thread.join(_PATIENCE_S)
        if self._viewer is not None:
            self._viewer.terminate()
            _wait(self._viewer)
        self._ready.close()

    def _follow(self) -> None:
        """Open the session's page once the hub listens, and watch the session to the end."""
        with ExitStack() as stack:
            client: zenoh.Session | None = None
            while not self.ended:
                hub = next((one for one in running_hubs() if one.pid == self._hub.pid), None)
                if hub is not None and client is None and is_listening(hub.endpoint):
                    with suppress(ConnectError, MessageError, zenoh.ZError):  # it has only begun to listen
                        client = stack.enter_context(reach(hub.endpoint, OBSERVER))
                        self._viewer = self._ready.page.run(
                            ("view", "--connect", hub.endpoint, "--no-open", "--one-session")
                        )
                if client is not None:
                    self._look(client)
                sleep(_LOOK_S)
        if self._hub.returncode and not self._asked_to_end:
            said = self._ready.hub.read_output()[-_MOST_SAID:]
            self.error = said.partition("error: ")[2].strip() or said.strip() or "it ended without a word"

    def _look(self, client: zenoh.Session) -> None:
        if not self.link and (found := _LINK.search(self._ready.page.read_output())):
            self.link = found[0]
        if self.time_s < self.live_from_s:
            for reply in client.get(Keys("*").status, timeout=_PATIENCE_S):
                if reply.ok is not None:
                    status = decode(SessionStatus, reply.ok.payload.to_bytes())
                    self.time_s = status.sim_time_ns / 1e9


class Started:
    """The sessions started from the pages of a server; all end with the server."""

    def __init__(self) -> None:
        self._sessions: list[StartedSession] = []
        self._ready: Ready | None = None
        self._lock = threading.Lock()

    def prepare(self, modules: Sequence[str]) -> None:
        """Have processes ready for a session about to be started; `modules`: imported by the hub."""
        with self._lock:
            if self._ready is None and not self._is_full:
                self._ready = Ready(modules)

    @property
    def waiting(self) -> tuple[subprocess.Popen[bytes], ...]:
        """The processes ready for a session."""
        return () if self._ready is None else (self._ready.hub.process, self._ready.page.process)

    @property
    def _is_full(self) -> bool:
        return sum(not one.ended for one in self._sessions) >= _MOST

    def start(self, title: str, arguments: Sequence[str], live_from_s: float = 0.0) -> StartedSession:
        """Start `trocar` with checked arguments; raises MessageError if too many sessions run already."""
        with self._lock:
            if self._is_full:
                raise MessageError(f"{_MOST} sessions that were started here are running: end one first")
            ready, self._ready = self._ready or Ready(()), None
            made = StartedSession(len(self._sessions) + 1, title, arguments, live_from_s, ready)
            self._sessions.append(made)
        log.info("%s: started from a page", title)
        return made

    def end(self, number: int) -> None:
        """End a session; raises MessageError if there is none of this number."""
        if not 1 <= number <= len(self._sessions):
            raise MessageError(f"no session {number} was started here")
        self._sessions[number - 1].end()

    def pids(self) -> set[int]:
        """Return the processes of the hubs."""
        return {one.pid for one in self._sessions}

    def as_json(self) -> list[dict[str, Any]]:
        """Return all sessions, ready for JSON."""
        return [one.as_json() for one in self._sessions]

    def close(self) -> None:
        """End all sessions."""
        for one in self._sessions:
            one.end()
        for one in self._sessions:
            one.close()
        if self._ready is not None:
            self._ready.close()


def page_devices(scenario: Scenario, names: Sequence[str]) -> list[str]:
    """Return the changes for pages to lead these devices; raises MessageError for an absent device."""
    if unknown := set(names) - set(scenario.participants):
        raise MessageError(f"there is no device '{min(unknown)}' in scenario '{scenario.name}'")
    return [f"participants.{name}={_PAGE_DEVICE}" for name in names]


def new_recording_path(parent: Path, stem: str) -> Path:
    """Return a new directory for a recording: the stem, or the stem and a number.

    No directory is returned twice: a session makes its own only when it begins.
    """
    names = (stem, *(f"{stem}-{number}" for number in range(2, 1000)))
    places = (parent / name for name in names)
    place = next(place for place in places if place not in _PROMISED and not place.exists())
    _PROMISED.add(place)
    return place


def _wait(process: subprocess.Popen[bytes]) -> None:
    try:
        process.wait(END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
