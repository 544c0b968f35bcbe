"""FMUs of C sources: compiled where an FMU has no library for this platform.

FMI 2.0.5 section 2.2.7 (SourceFiles), FMI 3.0.2 section 2.5.1.2 (buildDescription.xml).
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from schemas.errors import ScenarioError

if TYPE_CHECKING:
    from fmpy.model_description import ModelDescription

__all__ = ["NO_COMPILER", "find_compiler", "listed_sources", "provide_library"]

_FLAGS = ("-O2", "-fPIC", "-ffp-contract=off", "-fvisibility=hidden", "-shared")
"""A product and a sum are rounded one after the other, so that results do not depend on the processor."""
NO_COMPILER = "this machine has no C compiler; install cc, gcc or clang, or set CC"
_TIMEOUT_S = 300
_ERROR = re.compile(r"\berror: |undefined reference|cannot find ")
"""Marks an error of gcc, clang or the linker."""
_LONGEST_ERROR = 300


def find_compiler() -> str | None:
    """Return the C compiler of this machine: `CC`, or cc, gcc or clang on the path."""
    names = (os.environ.get("CC"), "cc", "gcc", "clang")
    return next((found for name in names if name and (found := shutil.which(name))), None)


def listed_sources(model: ModelDescription) -> tuple[str, ...]:
    """Return the C files of an FMU's library, relative to its folder `sources`; empty: it brings none."""
    found = [one for one in model.buildConfigurations if one.modelIdentifier == _identifier(model)]
    return tuple(name for one in found[:1] for part in one.sourceFileSets for name in part.sourceFiles)


def _identifier(model: ModelDescription) -> str | None:
    used = model.coSimulation or model.modelExchange
    return used.modelIdentifier if used else None


def provide_library(path: Path, directory: Path, library: str, sources: tuple[str, ...]) -> None:
    """Compile `library` in the FMU unpacked to `directory`, unless the FMU has it.

    Raises ScenarioError, with the compiler's first error, if the sources cannot be compiled.
    """
    target = directory / library
    if target.exists() or not sources:
        return
    root = directory / "sources"
    files = sorted(file for file in root.rglob("*") if file.is_file())
    contents = tuple((str(file.relative_to(root)), file.read_bytes()) for file in files)
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_bytes(_compile(path, contents, sources))


@lru_cache(maxsize=8)
def _compile(path: Path, contents: tuple[tuple[str, bytes], ...], sources: tuple[str, ...]) -> bytes:
    """Return the shared library of C files."""
    import fmpy

    compiler = find_compiler()
    if compiler is None:
        raise ScenarioError(f"'{path}': {NO_COMPILER}")
    with tempfile.TemporaryDirectory(prefix="trocar-fmu-") as folder:
        root = Path(folder)
        for name, content in contents:
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_bytes(content)
        headers = Path(fmpy.__file__).parent / "c-code"
        options = [*_FLAGS, f"-I{root}", f"-I{headers}", *sources, "-lm", "-o", "library.bin"]
        run = subprocess.run(
            [compiler, *options], cwd=root, capture_output=True, text=True, timeout=_TIMEOUT_S, check=False
        )
        if run.returncode:
            raise ScenarioError(
                f"the sources of '{path}' cannot be compiled by {compiler}: {_first_error(run.stderr)}"
            )
        return (root / "library.bin").read_bytes()


def _first_error(output: str) -> str:
    """Return the first error in a compiler's output, of which the rest mostly follows, and their number."""
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    errors = [line for line in lines if _ERROR.search(line)]
    first = (errors or lines or ["it says no reason"])[0]
    more = f" ({len(errors) - 1} further errors)" if len(errors) > 1 else ""
    return "".join(letter if letter.isprintable() else "?" for letter in first[:_LONGEST_ERROR]) + more
