"""Depths and forces of an indenter over time, from a CSV file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from schemas.errors import RecordingError, did_you_mean
from schemas.user_files import read_number_table
from schemas.vectors import Vector

__all__ = ["Measured", "read"]

_NEEDED = ("time", "depth", "force")
_SLIDING = ("slide", "tangential_force")
_FEWEST = 20


@dataclass(frozen=True)
class Measured:
    """Samples of a press, each of shape (n,)."""

    time: Vector
    """s, increasing."""
    depth: Vector
    """Depth below the unloaded surface, m; negative above."""
    force: Vector
    """N, along the depth; positive where the tissue pushes back."""
    slide: Vector | None = None
    """m, along the surface."""
    tangential_force: Vector | None = None
    """N, along the slide; None: not measured."""


def read(path: Path) -> Measured:
    """Return the samples of `path`, a CSV file with a line of names.

    Columns in any order: `time` (s), `depth` (m), `force` (N); for friction also `slide` (m) and
    `tangential_force` (N). Raises RecordingError for a missing column or an entry without a number.
    """
    names, table = read_number_table(path)
    for name in _NEEDED:
        if name not in names:
            raise RecordingError(f"'{path}' has no column '{name}'.{did_you_mean(name, names)}")
    if len(table) < _FEWEST:
        raise RecordingError(f"'{path}' has {len(table)} samples, at least {_FEWEST} are needed")
    columns = dict(zip(names, table.T.copy(), strict=True))
    if not all(np.isfinite(column).all() for column in columns.values()):
        raise RecordingError(f"'{path}' has numbers that are not finite: leave such samples out")
    if (np.diff(columns["time"]) <= 0.0).any():
        raise RecordingError(f"'{path}': the time does not increase from sample to sample")
    given = [name for name in (*_NEEDED, *_SLIDING) if name in columns]
    return Measured(**{name: columns[name] for name in given})
