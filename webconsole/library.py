"""The recordings that a page may open: those of the directory for which the server was started."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from hub.observation.outcome import verdict
from hub.observation.recorded_measures import recorded_measures
from hub.recording.recording import Recording
from hub.recording.scores import score_numbers
from schemas.errors import MessageError, RecordingError, did_you_mean
from schemas.readable import label
from webconsole.console import Console
from webconsole.open_recording import open_recording
from webconsole.pilot import Pilots
from webconsole.recorded import Recorded

__all__ = ["Library", "home_of", "numbers_of"]

_PLACES = "*.mcap", "*/*.mcap", "recordings/*/*.mcap"
"""Files; files in the directory of a recording; recordings that `trocar run --record` has named itself."""
_MOST_LISTED = 200
_MOST_OPEN = 4
"""Recordings kept open beside the server's own; a page keeps its recording in any case."""


def home_of(recording: Path | None) -> Path:
    """Return the directory of a recording, by default the working directory."""
    if recording is None:
        return Path.cwd()
    place = recording.resolve()
    return place.parent.parent if place.is_file() and _is_in_bag(place) else place.parent


def _is_in_bag(file: Path) -> bool:
    """Return whether a file stands in a rosbag2 directory, whose name is that of the recording."""
    return (file.parent / "metadata.yaml").is_file()


class Library:
    """Opens recordings by name, always without trust: nobody has vouched for a name in a list.

    Args:
        home: The directory.
        console: The server's own session or recording.
        stack: Closes what was opened.
    """

    def __init__(self, home: Path, console: Console, stack: ExitStack) -> None:
        self._home, self._own, self._stack = home.resolve(), console, stack
        self._open: OrderedDict[tuple[Path, int], Console] = OrderedDict()
        self._opening = asyncio.Lock()

    def rows(self) -> list[dict[str, Any]]:
        """Return name, start, scenario and duration of each recording, the newest first; ready for JSON."""
        files = sorted(self._files().items(), key=lambda one: one[1].stat().st_mtime, reverse=True)
        own = self._own.source.recording.file.resolve() if isinstance(self._own.source, Recorded) else None
        rows = [_row(name, file) | {"own": file == own} for name, file in files[:_MOST_LISTED]]
        return sorted(rows, key=lambda row: row["started"], reverse=True)

    async def console(self, name: str | None) -> Console:
        """Return the pages' contents of a recording, by default the server's own.

        Raises MessageError for a name that is not listed, RecordingError if the recording cannot be read.
        """
        if name is None:
            return self._own
        async with self._opening:
            file = await asyncio.to_thread(self._find, name)
            key = file, file.stat().st_mtime_ns
            found = self._open.get(key)
            if found is None:
                source = await asyncio.to_thread(open_recording, file, self._stack, trust=False)
                found = self._open[key] = Console(source, Pilots(), self._own.started)
                while len(self._open) > _MOST_OPEN:
                    self._open.popitem(last=False)
            self._open.move_to_end(key)
            return found

    def _find(self, name: str) -> Path:
        files = self._files()
        if name not in files:
            raise MessageError(
                f"there is no recording '{name:.80}' in {self._home}.{did_you_mean(name, files)}"
            )
        return files[name]

    def _files(self) -> dict[str, Path]:
        """Return the MCAP files by the name of the recording: the directory's, or the file's."""
        return dict(self._find_files())

    def _find_files(self) -> Iterator[tuple[str, Path]]:
        for file in (one for pattern in _PLACES for one in self._home.glob(pattern)):
            place = file.resolve()
            if not place.is_file() or not place.is_relative_to(self._home):  # a link may lead anywhere
                continue
            named = file.relative_to(self._home)
            yield (named if named.parent == Path() else named.parent).as_posix(), place


def _row(name: str, file: Path) -> dict[str, Any]:
    """Return the row of a recording, with `problem` if it cannot be read."""
    row: dict[str, Any] = {"name": name, "started": file.stat().st_mtime, "problem": ""}
    try:
        recording = Recording(file, unfinished=True)
        started_s = recording.started_ns() / 1e9
        row |= {"scenario": recording.scenario().name, "duration": recording.duration_ns / 1e9}
    except RecordingError as error:
        return row | {"scenario": "", "duration": None, "problem": str(error)}
    return row | ({"started": started_s} if started_s else {})


def numbers_of(recorded: Recorded) -> dict[str, Any]:
    """Return the result of a recorded session: sentence, success, and numbers with units; ready for JSON.

    A number without a value has a `reason`. Raises RecordingError.
    """
    recording = recorded.recording
    scenario, state, file = recording.scenario(), recorded.state, recording.file
    measures = recorded_measures(recording)
    results, missing = measures.results(), measures.missing()
    scores = {name: score_numbers(card) for name, card in measures.score_cards.items()}
    found = verdict(scenario, results, scores)
    numbers: list[tuple[str, float | None, str, str]] = [
        ("duration", state["end"] - state["start"], "s", ""),
        ("late steps", state["late"], "", ""),
        *(
            (name, value, scenario.measure[name].si_unit, missing.get(name, ""))
            for name, value in results.items()
        ),
    ]
    for card in scores.values():
        numbers.append(("goals reached", card["reached"], f"of {card['goals']}", ""))
        for group, values in {"": card["metrics"], **card["rules"]}.items():
            numbers += [
                (f"{group} {name}".strip(), one["value"], one["unit"], one.get("reason", ""))
                for name, one in values.items()
            ]
    return {
        "name": file.parent.name if _is_in_bag(file) else file.name,
        "text": found.text,
        "succeeded": found.succeeded,
        "state": state["state"],
        "numbers": [
            {"name": label(name, unit), "value": value, "unit": unit, "reason": reason}
            for name, value, unit, reason in numbers
        ],
    }
