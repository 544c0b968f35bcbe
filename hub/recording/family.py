"""Recordings and their forks as a tree."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hub.recording.fork_origin import ForkOrigin, fork_origin
from hub.recording.recording import Recording
from schemas.errors import RecordingError

__all__ = ["Member", "recording_family"]

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Member:
    """A recording, and the distance from the root of the tree."""

    file: Path
    depth: int
    session: str
    duration_ns: int
    origin: ForkOrigin | None


def recording_family(places: Iterable[Path]) -> Iterator[Member]:
    """Yield the recordings in and below `places`, each followed by its forks, the earliest fork first.

    An unfinished recording counts with its whole part. Files other than sessions, and unreadable files, are
    passed over with a line in the log. A fork without its parent here stands by itself.
    """
    found: dict[str, Member] = {}
    for file in sorted({file for place in places for file in _recording_files(place)}):
        try:
            recording = Recording(file, unfinished=True)
            first = next(recording.grants(), None)
            if first is not None:
                found[f"{first.run:x}"] = Member(
                    file, 0, recording.scenario().name, recording.duration_ns, fork_origin(recording)
                )
        except RecordingError as error:
            log.info("passed over: %s", error)
    children: dict[str, list[str]] = {}
    for run, one in found.items():
        origin = one.origin
        parent = origin.parent_run if origin is not None and origin.parent_run in found else ""
        children.setdefault(parent, []).append(run)
    yield from _tree_members(found, children, children.get("", []), 0)


def _tree_members(
    found: Mapping[str, Member], children: dict[str, list[str]], runs: Sequence[str], depth: int
) -> Iterator[Member]:
    for run in sorted(runs, key=lambda run: (_forked_at(found[run].origin), str(found[run].file))):
        yield replace(found[run], depth=depth)
        yield from _tree_members(found, children, children.pop(run, []), depth + 1)


def _forked_at(origin: ForkOrigin | None) -> int:
    return 0 if origin is None else origin.time_ns


def _recording_files(place: Path) -> Iterator[Path]:
    if place.is_file():
        yield place
    else:
        yield from (file for file in place.rglob("*.mcap") if file.is_file())
