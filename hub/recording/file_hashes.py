"""The hashes of the files that a session reads: a re-simulation compares them with those in the recording."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, cast

from pydantic import BaseModel

from hub.participant import Params

__all__ = ["file_hashes", "has_contents"]


def file_hashes(params: Iterable[Params], directory: Path) -> dict[str, str]:
    """Return the SHA-256 of every file that a `Path` in `params` names, by its full path.

    Relative paths start at `directory`. A directory stands for all files directly in it.
    """
    files: set[Path] = set()
    for named in _paths(list(params)):
        path = (directory / named).resolve()
        files |= {file for file in (path.iterdir() if path.is_dir() else (path,)) if file.is_file()}
    return {str(file): _hash(file) for file in sorted(files)}


def has_contents(path: Path, recorded: Collection[str]) -> bool:
    """Return whether there is a file at `path` whose hash is among those in `recorded`.

    A directory stands for all that is directly in it, so that one with a directory in it has none.
    """
    try:
        files = list(path.iterdir()) if path.is_dir() else [path]
        return bool(files) and all(file.is_file() and _hash(file) in recorded for file in files)
    except OSError:  # what cannot be read has no contents that could have been recorded
        return False


def _hash(file: Path) -> str:
    with file.open("rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()


def _paths(value: Any) -> Iterator[Path]:
    if isinstance(value, Path):
        yield value
    elif isinstance(value, BaseModel):
        yield from _paths(list(vars(value).values()))
    elif isinstance(value, Mapping):
        yield from _paths(list(cast("Mapping[Any, Any]", value).values()))
    elif isinstance(value, (list, tuple, set, frozenset)):
        for part in cast("Iterable[Any]", value):
            yield from _paths(part)
