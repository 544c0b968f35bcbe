"""Compiles the libraries that stand for the vendors': own code behind their C interfaces."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
COMPILER = shutil.which("cc") or shutil.which("gcc")
USABLE = COMPILER is not None and sys.platform == "linux"
WHY_NOT = "the vendors' libraries are stood for by C code: this needs 'cc' or 'gcc' and Linux"


def compile_library(source: str, library: Path, *flags: str) -> Path:
    """Compile `source`, a file of this folder, into the shared library `library` and return its path."""
    assert COMPILER, WHY_NOT
    options = ["-std=gnu11", "-O1", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", *flags]
    subprocess.run(
        [COMPILER, *options, str(HERE / source), "-lm", "-lpthread", "-o", str(library)], check=True
    )
    return library
