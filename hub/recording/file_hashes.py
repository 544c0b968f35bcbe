"""The hashes of the files read by a session: a re-simulation compares them with the recorded hashes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, cast

from pydantic import BaseModel

from hub.participant import Params
from schemas.files import file_hash

__all__ = ["file_hashes"]


def file_hashes(params: Iterable[Params], directory: Path) -> dict[str, str]:
    """Return the SHA-256 of every file named by a `Path` in `params`, keyed by full path.

    Relative paths start at `directory`. A directory stands for all files inside, at any depth: an FMU
    may be a directory with its sources.
    """
    files: set[Path] = set()
    for named in _paths_of(list(params)):
        path = (directory / named).resolve()
        files |= {file for file in (path.rglob("*") if path.is_dir() else (path,)) if file.is_file()}
    return {str(file): file_hash(file) for file in sorted(files)}


def _paths_of(value: Any) -> Iterator[Path]:
    if isinstance(value, Path):
        yield value
    elif isinstance(value, BaseModel):
        yield from _paths_of(list(vars(value).values()))
    elif isinstance(value, Mapping):
        yield from _paths_of(list(cast("Mapping[Any, Any]", value).values()))
    elif isinstance(value, (list, tuple, set, frozenset)):
        for part in cast("Iterable[Any]", value):
            yield from _paths_of(part)
