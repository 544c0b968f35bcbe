"""The files that parameters may name: a validation without `Files` in its context opens none."""

from __future__ import annotations

import hashlib
import stat
from collections.abc import Collection
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import ValidationInfo

__all__ = ["MAX_FILE_BYTES", "Files", "file_hash", "find_file", "has_contents"]

MAX_FILE_BYTES = 4 * 2**30
"""Size of a file or of all files in a directory: a bag of an hour with pictures has a third of it."""


class Files:
    """Where relative paths start, and which contents may be read.

    Args:
        directory: Where relative paths start.
        hashes: SHA-256 of every file that may be read; None: the user's own scenario may name any.
    """

    def __init__(self, directory: Path, hashes: Collection[str] | None = None) -> None:
        self.directory = directory
        self._hashes = hashes
        self._allowed: set[Path] = set()

    @cached_property
    def context(self) -> dict[str, Any]:
        """The context with which pydantic validates parameters."""
        return {"directory": self.directory, "files": self}

    def find(self, path: Path) -> Path:
        """Return the full path of a file or a directory of files; a missing one is left to its reader.

        Raises ValueError if a pipe, a device or anything else stands there that is not a regular file, if it
        is too large, or if it has other contents than the allowed ones.
        """
        if str(self.directory / path).startswith(("\\\\", "//")) and self._hashes is not None:
            raise ValueError(f"the network path '{path}' is not looked at")
        full = (self.directory / path).resolve()
        if full in self._allowed:
            return full
        if (problem := _problem(full)) and full.exists():
            raise ValueError(f"'{full}' {problem}")
        if self._hashes is not None and not has_contents(full, self._hashes):
            raise ValueError(f"the file '{full}' is missing or has other contents than those recorded")
        self._allowed.add(full)
        return full


def find_file(path: Path, info: ValidationInfo) -> Path:
    """Return the full path of a file that parameters name, for a validator that opens it.

    Raises ValueError if the validation has no `Files`: what is validated may be a stranger's.
    """
    context: dict[str, Any] = info.context or {}
    files: Files | None = context.get("files")
    if files is None and "directory" in context:
        files = Files(context["directory"])
    if files is None:
        raise ValueError(
            f"the file '{path}' is not opened: validate with `context=Files(directory).context`"
            " (schemas.files)"
        )
    return files.find(path)


def has_contents(path: Path, hashes: Collection[str]) -> bool:
    """Return whether there is a file at `path` whose SHA-256 is among `hashes`.

    A directory stands for all that is directly in it, so that a directory with another one in it has none.
    """
    if _problem(path):
        return False
    try:
        files = list(path.iterdir()) if path.is_dir() else [path]
        return bool(files) and all(file_hash(file) in hashes for file in files)
    except OSError:  # what cannot be read has no contents that could have been recorded
        return False


def file_hash(file: Path) -> str:
    """Return the SHA-256 of a file. Raises OSError if it cannot be read."""
    with file.open("rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()


def _problem(path: Path) -> str:
    """Return why there is neither a readable file nor a directory of them; empty if there is."""
    try:
        entries = [path, *path.iterdir()] if path.is_dir() else [path]
        stats = [entry.stat() for entry in entries if entry == path or entry.exists()]
    except (OSError, ValueError) as error:  # ValueError: a name with a zero byte
        return f"cannot be read: {error}"
    if not all(stat.S_ISREG(one.st_mode) or stat.S_ISDIR(one.st_mode) for one in stats):
        return "is, or holds, something else than regular files"
    if (size := sum(one.st_size for one in stats)) > MAX_FILE_BYTES:
        return f"has {size} bytes; at most {MAX_FILE_BYTES} are read"
    return ""
