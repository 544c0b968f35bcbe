"""Builds the test FMUs from their C sources. Nothing of the FMI standard's own headers is needed."""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Mapping
from pathlib import Path

HERE = Path(__file__).parent
COMPILER = shutil.which("cc") or shutil.which("gcc")
USABLE = COMPILER is not None and sys.platform == "linux" and platform.machine() == "x86_64"
WHY_NOT = "the test FMUs are compiled from C: this needs 'cc' or 'gcc' and Linux on x86_64"
FOLDERS = {
    "mass_spring_damper": "linux64",
    "bouncing_ball": "x86_64-linux",
    "stair": "linux64",
    "hopper": "linux64",
    "metronome": "x86_64-linux",
    "notes": "linux64",
    "flanges": "x86_64-linux",
}
"""Platform folders of FMI 2.0 and 3.0."""


def compile_library(model: str, folder: Path, *flags: str) -> Path:
    """Compile the shared library of `model` into `folder`."""
    assert COMPILER, WHY_NOT
    library = folder / f"{model}.so"
    options = ["-std=c11", "-O1", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC"]
    source = str(HERE / model / "model.c")
    subprocess.run([COMPILER, *options, source, "-lm", *flags, "-o", str(library)], check=True)
    return library


def pack(
    model: str,
    library: Path | None,
    path: Path,
    edits: Mapping[str, str] | None = None,
    folder: str | None = None,
    description: str = "modelDescription.xml",
) -> Path:
    """Write the FMU of `model` to `path`.

    Each key of `edits` is replaced by its value in the model's file `description`.
    """
    text = (HERE / model / description).read_text()
    for old, new in (edits or {}).items():
        assert old in text, old
        text = text.replace(old, new)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        if (terminals := HERE / model / "terminalsAndIcons.xml").exists():
            archive.write(terminals, f"terminalsAndIcons/{terminals.name}")
        if library:
            archive.write(library, f"binaries/{folder or FOLDERS[model]}/{library.name}")
    return path
