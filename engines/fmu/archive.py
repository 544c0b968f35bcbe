"""The archive of an FMU, perhaps from a stranger: checked before anything inside is read.

An FMU is a program: its library runs with all rights of the loading process, in spite of any check here. The
checks keep the earlier steps harmless: listing, validating or drawing a scenario reads modelDescription.xml
and loads nothing.
"""

from __future__ import annotations

import io
import stat
import zipfile
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from pathlib import Path
from typing import IO
from xml.parsers import expat

from schemas.errors import ScenarioError

__all__ = ["BROKEN_ENTRY", "TERMINALS", "find_archive_problem", "opened_archive", "unpack"]

LARGEST_FILE = 1 << 30
"""Most bytes of an unpacked file."""
LARGEST_TOTAL = 2 << 30
"""Bytes of all unpacked files together."""
LARGEST_XML = 128 << 20
"""Bytes of modelDescription.xml: 500 000 variables at some 250 bytes each."""
MOST_FILES = 100_000

BROKEN_ENTRY = (OSError, zipfile.BadZipFile, RuntimeError, NotImplementedError, EOFError)
"""Errors of `zipfile` for entries that are damaged, encrypted or packed in an unknown way."""
TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"
_READ_XML = ("modelDescription.xml", "sources/buildDescription.xml", TERMINALS)
"""Files that are parsed."""
_ENCRYPTED = 1
"""Bit of a ZIP entry's flags (APPNOTE.TXT 4.4.4)."""


@contextmanager
def opened_archive(path: Path) -> Generator[tuple[IO[bytes], zipfile.ZipFile]]:
    """Open the FMU at `path`, a file or an unpacked directory, as a file and as a checked archive.

    Raises ScenarioError if the archive could write outside its directory, is larger than the limits or brings
    XML entities, and the errors of `zipfile` for other files.
    """
    with _opened(path) as file, zipfile.ZipFile(file) as archive:
        problem = find_archive_problem(archive.infolist()) or _xml_problem(archive)
        if problem:
            raise ScenarioError(f"the FMU '{path}' is refused: {problem}")
        file.seek(0)
        yield file, archive


def _opened(path: Path) -> IO[bytes]:
    """Open the archive at `path`, or a directory as if it were packed."""
    if not path.is_dir():
        return path.open("rb")
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for file in sorted(path.rglob("*")):
            if file.is_file():
                archive.write(file, file.relative_to(path).as_posix())
    packed.seek(0)
    return packed


def unpack(path: Path, directory: Path) -> None:
    """Unpack the FMU at `path` into `directory`.

    Raises ScenarioError, with nothing written, for a refused archive.
    """
    with opened_archive(path) as (_, archive):
        try:
            archive.extractall(directory)
        except BROKEN_ENTRY as error:
            raise ScenarioError(f"the FMU '{path}' cannot be unpacked: {error}") from error


def find_archive_problem(entries: Iterable[zipfile.ZipInfo]) -> str:
    """Return the problem of an archive's entries, as a clause; empty: no problem."""
    total, seen = 0, set[str]()
    for count, entry in enumerate(entries, start=1):
        name = entry.orig_filename  # `filename` is cut at a NUL
        problem = _name_problem(name) or _kind_problem(entry)
        if problem:
            return f"its archive holds {name!r}, {problem}"
        if name in seen and not name.endswith("/"):  # a directory may stand there again: it holds nothing
            return f"its archive holds {name!r} twice"
        seen.add(name)
        total += entry.file_size
        limit = LARGEST_XML if name in _READ_XML else LARGEST_FILE
        if entry.file_size > limit:
            return f"{name!r} has {_size(entry.file_size)} unpacked, allowed are {_size(limit)}"
        if total > LARGEST_TOTAL:
            return f"it has more than {_size(LARGEST_TOTAL)} unpacked"
        if count > MOST_FILES:
            return f"its archive holds more than {MOST_FILES} files"
    return ""


def _name_problem(name: str) -> str:
    if "\\" in name or ":" in name or not name.isprintable():
        return "a name with a backslash, a colon or a control character"
    if name.startswith("/"):
        return "an absolute path"
    if set(name.removesuffix("/").split("/")) & {"", ".", ".."}:
        return "a path with an empty part, '.' or '..': it could leave the directory it is unpacked to"
    return ""


def _kind_problem(entry: zipfile.ZipInfo) -> str:
    kind = stat.S_IFMT(entry.external_attr >> 16)  # 0 where the archive was not made on Unix
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        return "a link" if kind == stat.S_IFLNK else "neither a file nor a directory"
    return "which is encrypted" if entry.flag_bits & _ENCRYPTED else ""


def _xml_problem(archive: zipfile.ZipFile) -> str:
    """Return the problem of the XML parsed by FMPy: a document type could declare entities.

    Entities expand without bound, or bring in files of this machine. FMI uses none.
    """
    for name in _READ_XML:
        if name in archive.namelist():
            with archive.open(name) as stream:
                problem = _prolog_problem(stream)
            if problem:
                return f"{name} {problem}"
    return ""


class _RootReachedError(Exception):
    """The root element begins: no document type can follow."""


class _DocumentTypeError(Exception):
    """A document type begins."""


def _prolog_problem(stream: IO[bytes]) -> str:
    """Return the problem of an XML file before the root element; the rest is left to FMPy."""

    def reached(*_: object) -> None:
        raise _RootReachedError

    def found(*_: object) -> None:
        raise _DocumentTypeError

    parser = expat.ParserCreate()
    parser.StartElementHandler = reached
    parser.StartDoctypeDeclHandler = found
    try:
        parser.ParseFile(stream)
    except _RootReachedError:
        return ""
    except _DocumentTypeError:
        return "has a document type (<!DOCTYPE>), which FMI does not use"
    except (expat.ExpatError, ValueError) as error:  # ValueError: UTF-7, which another parser may read
        return f"is not XML in UTF-8: {error}"
    return "has no root element"


def _size(count: int) -> str:
    return f"{count / (1 << 20):.0f} MiB"
