"""Files named by parameters: a validation without `Files` in its context opens none."""

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
    """The start of relative paths, and the contents open to readers.

    Args:
        directory: Where relative paths start.
        hashes: SHA-256 of every readable file; None: any file, as in a scenario of the user.
    """

    def __init__(self, directory: Path, hashes: Collection[str] | None = None) -> None:
        self.directory = directory
        self._hashes = hashes
        self._allowed: set[Path] = set()

    @cached_property
    def context(self) -> dict[str, Any]:
        """The context for the validation of parameters by pydantic."""
        return {"directory": self.directory, "files": self}

    def find(self, path: Path) -> Path:
        """Return the full path of a file or a directory of files; a missing file is left to its reader.

        Raises ValueError for a pipe, a device or any other irregular file, for a file that is too large, and
        for contents not allowed.
        """
        if str(self.directory / path).startswith(("\\\\", "//")) and self._hashes is not None:
            raise ValueError(f"the network path '{path}' is not looked at")
        try:
            full = (self.directory / path).resolve()
        except RuntimeError as error:  # before Python 3.13
            raise ValueError(f"'{self.directory / path}' is a link in a loop of links") from error
        if full in self._allowed:
            return full
        if (problem := _problem(full)) and not _is_missing(full):
            raise ValueError(f"'{full}' {problem}")
        if self._hashes is not None and not has_contents(full, self._hashes):
            raise ValueError(f"the file '{full}' is missing or has other contents than those recorded")
        self._allowed.add(full)
        return full

    def allows(self, path: Path) -> bool:
        """Return whether `find` accepts a path: contents are hashed once for both."""
        try:
            self.find(path)
        except ValueError:
            return False
        return True


def find_file(path: Path, info: ValidationInfo) -> Path:
    """Return the full path of a file for the validator of a parameter, before the validator opens the file.

    Raises ValueError if the validation has no `Files`: the parameters may be a stranger's.
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
    """Return whether the SHA-256 of the file at `path` is among `hashes`.

    A directory has allowed contents if all of its entries have; a directory inside has none.
    """
    if _problem(path):
        return False
    try:
        files = list(path.iterdir()) if path.is_dir() else [path]
        return bool(files) and all(file_hash(file) in hashes for file in files)
    except OSError:  # an unreadable file has no recorded contents
        return False


def file_hash(file: Path) -> str:
    """Return the SHA-256 of a file. Raises OSError if it cannot be read."""
    with file.open("rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()


def _is_missing(path: Path) -> bool:
    try:
        return not path.exists()
    except OSError:  # a name that is too long, or a directory that may not be read
        return False


def _problem(path: Path) -> str:
    """Return the reason against a file or a directory of files; empty if regular and small enough."""
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
