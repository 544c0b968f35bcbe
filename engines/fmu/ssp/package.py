"""The archive of a system (.ssp), perhaps from a stranger: checked before anything inside is read."""

from __future__ import annotations

import posixpath
import shutil
import zipfile
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO
from urllib.parse import unquote, urlsplit

from engines.fmu.archive import BROKEN_ENTRY, find_archive_problem
from engines.fmu.ssp.xml_file import Node, parse_xml
from schemas.errors import ScenarioError, did_you_mean

__all__ = ["DESCRIPTION", "Document", "Package", "open_package"]

DESCRIPTION = "SystemStructure.ssd"
"""Name of the description of the default system."""
_LARGEST_XML = 32 << 20
_MOST_INNER, _LARGEST_INNER = 20, 100 << 20
"""Number of archives inside archives, and bytes of each."""


class Package:
    """An open archive, checked, and the archives inside."""

    def __init__(self, label: str, file: IO[bytes], stack: ExitStack, opened: list[Package]) -> None:
        """Open the archive in `file`; `stack` closes it, `opened` has all packages in order."""
        self.label = label
        self._prefix = f"{label}/" if opened else ""
        opened.append(self)
        try:
            self._archive = stack.enter_context(zipfile.ZipFile(file))
        except (*BROKEN_ENTRY, ValueError) as error:
            raise ScenarioError(f"'{label}' is no system of SSP, which is a ZIP archive: {error}") from error
        if problem := find_archive_problem(self._archive.infolist()):
            raise ScenarioError(f"the system '{label}' is refused: {problem}")
        self.names = frozenset(self._archive.namelist())
        self._stack, self._opened = stack, opened
        self._inner: dict[str, Package] = {}
        self._roots: dict[str, Node] = {}

    def require_description(self, name: str = DESCRIPTION) -> Document:
        """Return the description of a system. Raises ScenarioError if there is none."""
        if name not in self.names:
            raise ScenarioError(
                f"'{self.label}' has no file '{name}', the description of a system."
                f"{did_you_mean(name, self.names)}"
            )
        return Document(self, name)

    def xml(self, name: str) -> Node:
        """Return the root element of a file of the archive. Raises ScenarioError."""
        if name not in self._roots:
            try:
                with self._archive.open(name) as stream:
                    data = stream.read(_LARGEST_XML + 1)
            except BROKEN_ENTRY as error:
                raise ScenarioError(f"'{name}' in '{self.label}' cannot be read: {error}") from error
            self._roots[name] = parse_xml(data, self._prefix + name)
        return self._roots[name]

    def resolve(self, source: str, folder: str, what: str) -> str:
        """Return the name of the entry for a URI relative to a folder of the archive.

        Raises ScenarioError for a missing entry and for any other URI: nothing outside the archive is read.
        """
        try:
            parts = urlsplit(source)
        except ValueError as error:
            raise ScenarioError(f"{what} names '{source}', which is no URI: {error}") from error
        name = posixpath.normpath(posixpath.join(folder, unquote(parts.path)))
        if parts.scheme or parts.netloc or name.startswith(("/", "../")) or name == "..":
            raise ScenarioError(
                f"{what} names '{source}': only files inside '{self.label}' are read, such as"
                " 'resources/plant.fmu'. Pack the file into the archive."
            )
        if name not in self.names:
            files = [one for one in self.names if not one.endswith("/")]
            raise ScenarioError(
                f"{what} names '{source}', which '{self.label}' does not hold.{did_you_mean(name, files)}"
            )
        return name

    def extract(self, name: str, target: IO[bytes]) -> None:
        """Write an entry to an open file. Raises ScenarioError."""
        try:
            with self._archive.open(name) as stream:
                shutil.copyfileobj(stream, target)
        except BROKEN_ENTRY as error:
            raise ScenarioError(f"'{name}' in '{self.label}' cannot be unpacked: {error}") from error

    def open_inner(self, name: str) -> Package:
        """Return the archive inside this one. Raises ScenarioError for a broken one, and for too many."""
        if name not in self._inner:
            if len(self._opened) > _MOST_INNER:
                raise ScenarioError(
                    f"'{self.label}' brings more than {_MOST_INNER} systems in files of their own"
                )
            if self._archive.getinfo(name).file_size > _LARGEST_INNER:
                raise ScenarioError(f"'{name}' in '{self.label}' is larger than {_LARGEST_INNER} bytes")
            file = self._stack.enter_context(TemporaryFile())  # noqa: SIM115  # the stack closes it
            self.extract(name, file)
            self._inner[name] = Package(self._prefix + name, file, self._stack, self._opened)
        return self._inner[name]


@dataclass(frozen=True)
class Document:
    """A file of an archive, from which relative URIs start."""

    package: Package
    name: str

    def xml(self) -> Node:
        """Return the root element. Raises ScenarioError."""
        return self.package.xml(self.name)

    def resolve(self, source: str, what: str) -> Document:
        """Return the file of a relative URI. Raises ScenarioError for other URIs and missing files."""
        return Document(self.package, self.package.resolve(source, posixpath.dirname(self.name), what))

    def open_package(self, source: str, what: str) -> Document:
        """Return the description inside an archive at a relative URI. Raises ScenarioError."""
        name = self.resolve(source, what).name
        fragment = source.partition("#")[2]
        return self.package.open_inner(name).require_description(unquote(fragment) or DESCRIPTION)


@contextmanager
def open_package(path: Path) -> Generator[Document]:
    """Open the description of the system at `path`.

    Raises ScenarioError if it is no archive of a system, or a refused one.
    """
    if not path.is_file():
        raise ScenarioError(f"the system '{path}' does not exist")
    with ExitStack() as stack:
        yield Package(path.name, stack.enter_context(path.open("rb")), stack, []).require_description()
