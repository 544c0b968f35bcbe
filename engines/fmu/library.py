"""The shared library of an FMU: availability for this platform, and loading."""

from __future__ import annotations

import contextlib
import ctypes
import re
from collections.abc import Collection
from pathlib import Path
from typing import Any

from engines.fmu.description import Description
from schemas.errors import ScenarioError, SessionError

__all__ = ["Library", "load_library"]

_ABSENT = re.compile(
    r"(?P<file>(?P<name>[\w.+-]+?)\.so(?:\.(?P<version>\d+))?[\d.]*): cannot open shared object"
)
"""Message of the Linux loader about a missing dependency of a library (dlerror, glibc and musl)."""


class Library:
    """A loaded library. A call of a missing function raises SessionError.

    Tools leave out functions without use in their FMU, such as `fmi2DeSerializeFMUstate` (FMI 2.0.4 section
    2.1.8: optional by capability flag); FMPy looks up all functions while loading a library.
    """

    def __init__(self, library: ctypes.CDLL) -> None:
        self._library = library
        self._handle = library._handle
        self._absent: dict[str, _AbsentFunction] = {}

    def __getattr__(self, name: str) -> Any:
        """Return the function `name`."""
        try:
            return getattr(self._library, name)
        except AttributeError:
            if not name.startswith("fmi"):
                raise
            return self._absent.setdefault(name, _AbsentFunction(name))

    def has(self, *names: str) -> bool:
        """Return whether the library has all of the functions `names`."""
        return not self.missing(names)

    def missing(self, names: Collection[str]) -> list[str]:
        """Return the functions among `names` missing in the library."""
        return [name for name in names if isinstance(getattr(self, name), _AbsentFunction)]


class _AbsentFunction:
    """Stands for a missing function of a library; FMPy sets C types as attributes."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __call__(self, *_: object) -> int:
        raise SessionError(f"the FMU's library has no function '{self._name}'")


def load_library(slave: type[Any], description: Description, directory: Path, name: str) -> Any:
    """Load the FMU unpacked to `directory` through FMPy's class `slave`, as instance `name`.

    The `dll` of the result is a `Library`. Raises ScenarioError if the library cannot be loaded.
    """

    def look_up_functions(fmu: Any) -> None:
        fmu.dll = Library(fmu.dll)
        slave._loadFunctions(fmu)

    # FMPy goes by the start of the class's name
    tolerant = type(f"{slave.__name__}WithLibrary", (slave,), {"_loadFunctions": look_up_functions})
    try:
        # FMPy changes the directory to load, and leaves it changed when that fails
        with contextlib.chdir(Path.cwd()):
            return tolerant(
                guid=description.guid,
                modelIdentifier=description.interface.modelIdentifier,
                unzipDirectory=str(directory),
                instanceName=name,
            )
    except Exception as error:  # FMPy raises a bare Exception
        text = _needed(str(error)) or str(error)
        raise ScenarioError(f"the library of '{description.path}' cannot be loaded: {text}") from error


def _needed(error: str) -> str:
    """Return the missing system library with the remedy; empty for another error.

    Debian's package of a library is named after its soname (Debian Policy 8.1): libgfortran.so.3 is in
    libgfortran3.
    """
    found = _ABSENT.search(error)
    if found is None:
        return ""
    name, version = found["name"].lower().replace("_", "-"), found["version"] or ""
    package = f"{name}-{version}" if version and name[-1].isdigit() else f"{name}{version}"
    return (
        f"it needs the system library '{found['file']}', which is not installed. Install the package that has"
        f" it, on Debian and Ubuntu '{package}' (apt-file search {found['file']} lists others); where the"
        " distribution no longer has it, run the FMU on one that does, or export it again with a newer tool."
    )
