"""Parses a stranger's file in a process of its own: limits, and a sentence for every failure."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schemas.errors import MissingExtraError

__all__ = ["parse_file"]

_LARGEST_FILE = 128 * 10**6
"""Bytes: an STL of two and a half million triangles."""
_PATIENCE_S = 180.0
"""Wall time for a parser; a file of the largest size takes some 10 s."""


def parse_file(path: Path, parser: str, packages: tuple[str, ...]) -> dict[str, NDArray[Any]]:
    """Return the arrays that `parser`, a module with two arguments, makes of a file.

    Args:
        path: a file of another program.
        parser: name of the module; last lines of its traceback become the reason.
        packages: packages of the extra `meshes` that the parser needs.

    Raises ValueError, naming the file.
    """
    for package in packages:
        if find_spec(package) is None:
            raise MissingExtraError(f"mesh {path}", "meshes", package)
    _require_small_file(path)
    with TemporaryDirectory(prefix="trocar-") as directory:
        result = Path(directory) / "arrays.npz"
        command = [sys.executable, "-P", "-m", parser, str(path), str(result)]
        try:
            done = subprocess.run(
                command, capture_output=True, timeout=_PATIENCE_S, check=False, stdin=subprocess.DEVNULL
            )
        except subprocess.TimeoutExpired as error:
            raise ValueError(
                f"mesh {path}: its parser took more than {_PATIENCE_S:g} s; is it {path.suffix}?"
            ) from error
        if done.returncode or not result.is_file():
            raise ValueError(f"mesh {path}{_reason(done, path.suffix)}")
        with np.load(result, allow_pickle=False) as arrays:
            return dict(arrays)


def _require_small_file(path: Path) -> None:
    """Raise ValueError unless `path` is a regular file of at most `_LARGEST_FILE` bytes."""
    try:
        if not path.is_file():
            raise ValueError(f"mesh {path} is no file" if path.exists() else f"mesh {path}: no such file")
        size = path.stat().st_size
    except OSError as error:
        raise ValueError(f"mesh {path} cannot be read: {error.strerror}") from error
    if size > _LARGEST_FILE:
        raise ValueError(
            f"mesh {path} has {size // 10**6} MB; at most {_LARGEST_FILE // 10**6} MB are read: decimate it"
        )


def _reason(done: subprocess.CompletedProcess[bytes], suffix: str) -> str:
    """Return why a parser failed, from the last line of its traceback."""
    lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
    if done.returncode < 0 or not lines:
        return f" cannot be read: its parser ended with {done.returncode}"
    last = "".join(sign if sign.isprintable() else "?" for sign in lines[-1])[:300]
    if last.startswith("ValueError: "):
        return f": {last.removeprefix('ValueError: ')}"
    return f" is no {suffix} file that can be read: {last}"
