"""Directories made by a command of ours: marked, used by a single process, and without links.

A directory may come from somebody else. A link there would lead writing, or removal, to a strange place.
"""

from __future__ import annotations

import os
import shutil
import stat
import sys
from collections.abc import Generator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from schemas.errors import ScenarioError

__all__ = ["MARKER", "NewDirectory", "claim_directory", "whole_file"]

MARKER = ".trocar"
"""Name of the file with the command that has made a directory; locked while the command runs."""

if sys.platform == "win32":
    import msvcrt

    def _lock(descriptor: int) -> None:
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)

else:
    import fcntl

    def _lock(descriptor: int) -> None:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextmanager
def claim_directory(directory: Path, purpose: str) -> Generator[None]:
    """Make `directory`, or go on with a directory made for `purpose`, and keep other processes out.

    Raises ScenarioError if the directory holds something else, or a link, or if another process uses it.
    """
    descriptor = _open_marker(directory, purpose)
    try:
        try:
            _lock(descriptor)
        except OSError as error:
            raise ScenarioError(
                f"another process uses '{directory}' now: wait until it has ended, or name another directory"
            ) from error
        _require_plain(directory)
        yield
    finally:
        os.close(descriptor)


def _open_marker(directory: Path, purpose: str) -> int:
    """Return a descriptor of the marker; a new or empty directory gets a marker."""
    marker, flags = directory / MARKER, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        if not any(directory.iterdir()):
            with suppress(FileExistsError), marker.open("x", encoding="utf-8") as file:
                file.write(purpose)
        if stat.S_ISREG(marker.lstat().st_mode) and marker.read_text("utf-8") in (purpose, ""):
            return os.open(marker, flags)
    except FileNotFoundError:
        pass
    except (OSError, ValueError) as error:
        raise ScenarioError(f"'{directory}' cannot be used: {error}; name another directory") from error
    raise ScenarioError(
        f"'{directory}' holds something else than a {purpose}: it has no file '{MARKER}' that says so. Name a"
        " new directory"
    )


def _require_plain(directory: Path) -> None:
    """Raise ScenarioError if there is anything but files and directories below `directory`."""
    for place, folders, files in os.walk(directory):
        for path in (Path(place, name) for name in (*folders, *files)):
            mode = path.lstat().st_mode
            if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
                kind = "a link" if stat.S_ISLNK(mode) else "neither a file nor a directory"
                raise ScenarioError(f"'{path}' is {kind}, which we have not made: remove it")


@contextmanager
def whole_file(file: Path) -> Generator[Path]:
    """Yield the path of a new file to replace `file` in the end, without following links."""
    part = file.with_suffix(".part")
    part.unlink(missing_ok=True)
    yield part
    part.replace(file)


class NewDirectory:
    """A directory in the making, beside its place until `publish`; else nothing is left.

    Args:
        place: Place of the finished directory, where nothing or an empty directory stands.
        purpose: Purpose, in a word.

    Raises ScenarioError as `claim_directory` does.
    """

    def __init__(self, place: Path, purpose: str) -> None:
        self._place = place.resolve()
        self.path = self._place.with_name(f"{self._place.name}.part")
        self._purpose = purpose
        self._claim = ExitStack()

    def __enter__(self) -> Self:
        self._claim.enter_context(claim_directory(self.path, self._purpose))
        for left in self.path.iterdir():  # of a process that was killed
            if left.is_dir():
                shutil.rmtree(left)
            elif left.name != MARKER:
                left.unlink()
        return self

    def publish(self) -> None:
        """Put the directory in its place. Raises ScenarioError if something else has come to stand there."""
        if sys.platform == "win32":  # there an open file keeps its directory where it is
            self._claim.close()
        try:
            with suppress(FileNotFoundError):
                self._place.rmdir()  # it is empty
            self.path.rename(self._place)
            (self._place / MARKER).unlink()
        except OSError as error:
            raise ScenarioError(f"'{self._place}' cannot be written: {error}") from error

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Remove an unpublished directory."""
        shutil.rmtree(self.path, ignore_errors=True)
        self._claim.close()
