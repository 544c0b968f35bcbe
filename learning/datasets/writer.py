"""Writes a LeRobotDataset, format v3.0, which LeRobot's own loader reads.

    DIR/meta/info.json                                   features, rates, counts
    DIR/meta/stats.json                                  statistics of all episodes
    DIR/meta/tasks.parquet                               task texts and their numbers
    DIR/meta/episodes/chunk-000/file-000.parquet         where each episode lies, and its statistics
    DIR/meta/recordings.json                             ours: which recording each episode is
    DIR/data/chunk-000/file-000.parquet                  a row for each frame
    DIR/videos/observation.images.left/chunk-000/file-000.mp4    and right: all episodes, one after the other

https://huggingface.co/docs/lerobot/lerobot-dataset-v3 describes it; what its loader asks for beyond that is
from lerobot 0.4.4, `lerobot/datasets`.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from pandas import DataFrame, Index

from learning.datasets.episode import Episode
from learning.datasets.features import INDICES, VIDEO_KEYS, features, info
from learning.datasets.pictures import Pair
from learning.datasets.statistics import PictureCounts, vector_statistics
from learning.datasets.video import Video
from schemas.errors import RecordingError

__all__ = ["Writer"]

_MB = 2**20
_CHUNK = "chunk-{:03d}/file-{:03d}"
_META = {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}


class Writer:
    """A data set that grows by episodes; it is whole after any of them, once it is closed."""

    def __init__(self, directory: Path, fps: int, size: tuple[int, int], first: Episode) -> None:
        """Begin in `directory`; all episodes have the columns of `first`, and pictures of `size`."""
        self._directory, self._fps, self._size = directory, fps, size
        self._state, self._action = first.state_names, first.action_names
        self._features = features(self._state, self._action, size, fps)
        self._info = info(self._features, fps, 0, 0, 0)
        self._tasks: dict[str, int] = {}
        self._episodes: list[dict[str, Any]] = []
        self._sources: list[dict[str, Any]] = []
        self._rows: dict[str, list[NDArray[Any]]] = {}
        self._pictures = {key: PictureCounts() for key in VIDEO_KEYS}
        self._data: pq.ParquetWriter | None = None
        self._data_file, self._video_file = 0, 0
        self._videos: dict[str, Video] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def episodes(self) -> int:
        """How many there are."""
        return len(self._episodes)

    @property
    def frames(self) -> int:
        """How many frames they have together."""
        return self._episodes[-1]["dataset_to_index"] if self._episodes else 0

    def add(self, episode: Episode, count: int, pairs: Iterator[Pair], source: Mapping[str, Any]) -> None:
        """Append the first `count` frames of an episode and their pictures.

        `source` says where it is from, for `meta/recordings.json`. Raises RecordingError if its columns are
        others, or if there are fewer pictures; what `pairs` raises leaves the data set as it was, but for
        frames of video that no episode refers to.
        """
        self._check(episode)
        row = {"episode_index": self.episodes, "tasks": [episode.task], "length": count}
        counts, places = self._add_pictures(pairs, count)
        task = self._tasks.setdefault(episode.task, len(self._tasks))
        columns = self._columns(episode, count, task)
        row |= self._add_rows(columns) | places
        row |= {"dataset_from_index": self.frames, "dataset_to_index": self.frames + count}
        statistics = {name: vector_statistics(_table(values)) for name, values in columns.items()}
        statistics |= {key: one.statistics() for key, one in counts.items()}
        row |= {f"stats/{name}/{key}": v for name, one in statistics.items() for key, v in one.items()}
        for name, values in columns.items():
            self._rows.setdefault(name, []).append(values)
        for key, one in counts.items():
            self._pictures[key].merge(one)
        self._episodes.append(row | _META)
        self._sources.append({"episode_index": row["episode_index"], **source})

    def _check(self, episode: Episode) -> None:
        for what, there, here in (
            ("state", episode.state_names, self._state),
            ("action", episode.action_names, self._action),
        ):
            if there != here:
                other = sorted({*there} ^ {*here}) or ["their order"]
                raise RecordingError(
                    f"'{episode.recording.file}' has another {what} than the first recording of the data set"
                    f" ({', '.join(other)}): give it a data set of its own, or name ports with --{what}"
                )

    def _columns(self, episode: Episode, count: int, task: int) -> dict[str, NDArray[Any]]:
        frame = np.arange(count)
        numbers = {
            "frame_index": frame,
            "episode_index": np.full(count, self.episodes),
            "index": self.frames + frame,
            "task_index": np.full(count, task),
        }
        return {
            "observation.state": episode.state[:count],
            "action": episode.action[:count],
            "timestamp": (frame / self._fps).astype(np.float32),
            **{name: numbers[name].astype(np.int64) for name in INDICES},
        }

    def _add_pictures(
        self, pairs: Iterator[Pair], count: int
    ) -> tuple[dict[str, PictureCounts], dict[str, Any]]:
        """Append frames to the videos; return what is in them, and where they are."""
        videos = self._open_videos()
        first = {key: video.frames for key, video in videos.items()}
        counts = {key: PictureCounts() for key in VIDEO_KEYS}
        drawn = 0
        for pair in pairs:
            for key, picture in zip(VIDEO_KEYS, pair, strict=True):
                videos[key].add(picture)
                counts[key].add(picture)
            drawn += 1
        if drawn != count:
            raise RecordingError(f"{drawn} pictures for {count} frames")
        places: dict[str, Any] = {}
        for key in VIDEO_KEYS:
            chunk, file = divmod(self._video_file, self._info["chunks_size"])
            places |= {f"videos/{key}/chunk_index": chunk, f"videos/{key}/file_index": file}
            places[f"videos/{key}/from_timestamp"] = first[key] / self._fps
            places[f"videos/{key}/to_timestamp"] = (first[key] + count) / self._fps
        return counts, places

    def _open_videos(self) -> dict[str, Video]:
        """Return the videos of both eyes, new ones if one of the old has become too large."""
        limit = self._info["video_files_size_in_mb"] * _MB
        if any(video.size_bytes > limit for video in self._videos.values()):
            self._close_videos()
            self._video_file += 1
        if not self._videos:
            self._videos = {
                key: Video(self._file(f"videos/{key}", self._video_file, "mp4"), self._size, self._fps)
                for key in VIDEO_KEYS
            }
        return self._videos

    def _close_videos(self) -> None:
        for video in self._videos.values():
            video.close()
        self._videos = {}

    def _add_rows(self, columns: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
        """Append rows to the data; return where they are."""
        table = pa.table({name: _to_arrow_column(values) for name, values in columns.items()})
        limit = self._info["data_files_size_in_mb"] * _MB
        file = self._file("data", self._data_file, "parquet")
        if self._data is not None and file.stat().st_size > limit:
            self._data.close()
            self._data = None
            self._data_file += 1
            file = self._file("data", self._data_file, "parquet")
        if self._data is None:
            file.parent.mkdir(parents=True, exist_ok=True)
            self._data = pq.ParquetWriter(file, table.schema)
        self._data.write_table(table)  # a group of rows for each episode
        chunk, number = divmod(self._data_file, self._info["chunks_size"])
        return {"data/chunk_index": chunk, "data/file_index": number}

    def close(self) -> None:
        """Finish all files. May be called twice."""
        self._close_videos()
        if self._data is not None:
            self._data.close()
            self._data = None
        if self._episodes:
            self._write_meta()

    def _write_meta(self) -> None:
        meta = self._directory / "meta"
        (meta / "episodes" / "chunk-000").mkdir(parents=True, exist_ok=True)
        pq.write_table(
            pa.Table.from_pylist(self._episodes), meta / "episodes" / f"{_CHUNK.format(0, 0)}.parquet"
        )
        # the loader finds a task's text as the name of its row, which is an index of pandas
        texts = Index(np.array(list(self._tasks), object), name="task")
        DataFrame(np.arange(len(texts))[:, None], texts, ["task_index"]).to_parquet(meta / "tasks.parquet")
        statistics = {
            name: vector_statistics(_table(np.concatenate(rows))) for name, rows in self._rows.items()
        }
        statistics |= {key: one.statistics() for key, one in self._pictures.items()}
        _write(meta / "stats.json", statistics)
        _write(meta / "recordings.json", self._sources)
        _write(
            meta / "info.json",
            info(self._features, self._fps, self.episodes, self.frames, len(self._tasks)),
        )

    def _file(self, folder: str, number: int, ending: str) -> Path:
        place = _CHUNK.format(*divmod(number, self._info["chunks_size"]))
        return self._directory / folder / f"{place}.{ending}"


def _table(values: NDArray[Any]) -> NDArray[Any]:
    return values.reshape(len(values), -1)


def _to_arrow_column(values: NDArray[Any]) -> Any:
    """Return rows as a column: lists of fixed length, or bare numbers where there is one in a row."""
    flat = pa.array(values.reshape(-1))
    width = values.size // len(values)
    return pa.FixedSizeListArray.from_arrays(flat, width) if width > 1 else flat


def _write(file: Path, content: Any) -> None:
    file.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
