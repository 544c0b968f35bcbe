"""Set-points of an episode: a LeRobotDataset v2.1 or v3.0, or a directory of SutureBot with `ee_csv.csv`."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from learning.relive.convention import Convention
from schemas.errors import RecordingError
from schemas.vectors import Vector

__all__ = ["EpisodeFile"]

_CSV = "ee_csv.csv"
_LARGEST = 512 * 2**20
"""Bytes of a file read."""
_DEFAULT_FPS = 30.0
_FIELDS = (
    "position.x",
    "position.y",
    "position.z",
    "orientation.x",
    "orientation.y",
    "orientation.z",
    "orientation.w",
)


@dataclass(frozen=True)
class EpisodeFile:
    """Set-points of an episode."""

    rows: Vector
    """Shape (n, numbers)."""
    fps: float
    frame: str | None
    """Reference frame that the data set states; None: not stated."""

    @classmethod
    def read(cls, dataset: Path, episode: int, convention: Convention) -> EpisodeFile:
        """Read an episode. Raises RecordingError if there is none."""
        try:
            if (dataset / _CSV).is_file():
                return cls(_read_csv(dataset / _CSV, convention), _DEFAULT_FPS, None)
            info = json.loads(_check_size(dataset / "meta/info.json").read_text("utf-8"))
            rows = _read_rows(dataset, episode, convention.key, info)
            return cls(rows, float(info["fps"]), info.get("frame"))
        except RecordingError:
            raise
        except (OSError, ValueError, KeyError, TypeError, ArithmeticError) as error:
            raise RecordingError(f"'{dataset}' is no data set that can be read: {error}") from error


def _read_rows(dataset: Path, episode: int, key: str, info: dict[str, Any]) -> Vector:
    import pyarrow.parquet as pq

    numbers = {"episode_chunk": episode // int(info.get("chunks_size", 1000)), "episode_index": episode}
    if info["codebase_version"] == "v2.1":
        files = [dataset / info["data_path"].format(**numbers)]
    elif info["codebase_version"] == "v3.0":
        files = sorted((dataset / "data").glob("chunk-*/file-*.parquet"))
    else:
        raise RecordingError(f"'{dataset}' has format {info['codebase_version']}; v2.1 and v3.0 are read")
    for file in files:
        if not file.is_file():
            continue
        table: Any = pq.read_table(_check_size(file))
        if key not in table.column_names:
            raise RecordingError(f"'{file}' has no column '{key}'; there are {', '.join(table.column_names)}")
        mask = np.array(table["episode_index"].to_pylist()) == episode
        if mask.any():
            return np.array(table[key].to_pylist(), np.float64)[mask]
    raise RecordingError(f"'{dataset}' has no episode {episode}; there are {info['total_episodes']}, from 0")


def _read_csv(file: Path, convention: Convention) -> Vector:
    """Return the set-points of SutureBot's table, by the names of its columns."""
    with _check_size(file).open(encoding="utf-8", newline="") as lines:
        table = list(csv.DictReader(lines))
    names = [
        name
        for arm in convention.arms
        for name in (*(f"{arm.lower()}_sp.{field}" for field in _FIELDS), f"{arm.lower()}_jaw_sp")
    ]
    columns = table[0] if table else {}
    if missing := [name for name in names if name not in columns]:
        raise RecordingError(f"'{file}' has no column {', '.join(missing[:3])}")
    return np.array([[float(row[name]) for name in names] for row in table])


def _check_size(file: Path) -> Path:
    if file.stat().st_size > _LARGEST:
        raise RecordingError(f"'{file}' is larger than {_LARGEST >> 20} MiB")
    return file
