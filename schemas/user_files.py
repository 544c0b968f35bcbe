"""Files that a user names: tables of numbers to read, places for results."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from schemas.errors import RecordingError
from schemas.vectors import Vector

__all__ = ["read_number_table", "require_place"]


def read_number_table(path: Path) -> tuple[list[str], Vector]:
    """Return the names of the columns, and the numbers of a CSV file, shape (rows, columns).

    Raises RecordingError if a cell is not a number, or a line has more or fewer numbers than there are names.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = csv.reader(file)
            names = [name.strip() for name in next(lines, list[str]())]
            rows: list[list[float]] = []
            for line in lines:
                if line and len(line) != len(names):
                    raise RecordingError(
                        f"'{path}': line {lines.line_num} has {len(line)} numbers, the first line"
                        f" {len(names)} names"
                    )
                if line:
                    rows.append([float(cell) for cell in line])
    except OSError as error:
        raise RecordingError(f"cannot read '{path}': {error.strerror}") from error
    except (ValueError, csv.Error) as error:
        raise RecordingError(
            f"'{path}' is not a table of numbers below a line of names: {error!s:.200}"
        ) from error
    return names, np.array(rows, np.float64).reshape(-1, max(1, len(names)))


def require_place(file: Path) -> None:
    """Raise RecordingError if `file` cannot be written, for want of a directory or as it is a directory."""
    if not file.parent.is_dir():
        raise RecordingError(f"'{file}' cannot be written: there is no directory '{file.parent}'; make it")
    if file.is_dir():
        raise RecordingError(f"'{file}' cannot be written: it is a directory; name a file")
