"""The archive of a system (.ssp), perhaps from a stranger: checked before anything inside is read."""

from __future__ import annotations

import posixpath
import zipfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import IO
from urllib.parse import unquote, urlsplit

from engines.fmu.archive import find_archive_problem
from engines.fmu.ssp.xml_file import Node, parse_xml
from schemas.errors import ScenarioError, did_you_mean

__all__ = ["DESCRIPTION", "Package", "open_package"]

DESCRIPTION = "SystemStructure.ssd"
"""Name of the description of the default system."""
_LARGEST_XML = 32 << 20
_CHUNK = 1 << 20


class Package:
    """An open archive, checked."""

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        self.path = path
        self._archive = archive
        self.names = frozenset(archive.namelist())

    def xml(self, name: str) -> Node:
        """Return the root element of a file of the archive. Raises ScenarioError."""
        try:
            with self._archive.open(name) as stream:
                data = stream.read(_LARGEST_XML + 1)
        except (OSError, zipfile.BadZipFile, RuntimeError, NotImplementedError, EOFError) as error:
            raise ScenarioError(f"'{name}' in '{self.path}' cannot be read: {error}") from error
        return parse_xml(data, name)

    def resolve(self, source: str, what: str) -> str:
        """Return the name of the entry for a relative URI.

        Raises ScenarioError for a missing entry and for any other URI: nothing outside the archive is read.
        """
        try:
            parts = urlsplit(source)
        except ValueError as error:
            raise ScenarioError(f"{what} names '{source}', which is no URI: {error}") from error
        name = posixpath.normpath(unquote(parts.path))
        if parts.scheme or parts.netloc or name.startswith(("/", "../")) or name == "..":
            raise ScenarioError(
                f"{what} names '{source}': only files inside '{self.path.name}' are read, such as"
                " 'resources/plant.fmu'. Pack the file into the archive."
            )
        if name not in self.names:
            files = [one for one in self.names if not one.endswith("/")]
            raise ScenarioError(
                f"{what} names '{source}', which '{self.path.name}' does not hold.{did_you_mean(name, files)}"
            )
        return name

    def extract(self, name: str, file: Path) -> None:
        """Write an entry to `file`. Raises ScenarioError."""
        try:
            with self._archive.open(name) as stream, file.open("wb") as target:
                _copy(stream, target)
        except (OSError, zipfile.BadZipFile, RuntimeError, NotImplementedError, EOFError) as error:
            raise ScenarioError(f"'{name}' in '{self.path}' cannot be unpacked: {error}") from error


def _copy(stream: IO[bytes], target: IO[bytes]) -> None:
    while chunk := stream.read(_CHUNK):
        target.write(chunk)


@contextmanager
def open_package(path: Path) -> Generator[Package]:
    """Open the system at `path`. Raises ScenarioError if it is no archive of a system, or a refused one."""
    if not path.is_file():
        raise ScenarioError(f"the system '{path}' does not exist")
    try:
        archive = zipfile.ZipFile(path)
    except (OSError, zipfile.BadZipFile, ValueError, NotImplementedError) as error:
        raise ScenarioError(f"'{path}' is no system of SSP, which is a ZIP archive: {error}") from error
    with archive:
        if problem := find_archive_problem(archive.infolist()):
            raise ScenarioError(f"the system '{path}' is refused: {problem}")
        package = Package(path, archive)
        if DESCRIPTION not in package.names:
            raise ScenarioError(
                f"'{path}' has no file '{DESCRIPTION}', the description of a system."
                f"{did_you_mean(DESCRIPTION, package.names)}"
            )
        yield package
