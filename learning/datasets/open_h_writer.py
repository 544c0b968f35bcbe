"""Writes a LeRobotDataset of format v2.1 with the names of Open-H-Embodiment.

DIR/meta/info.json             features, rates, counts, splits
DIR/meta/episodes.jsonl        length and task of each episode
DIR/meta/episodes_stats.jsonl  statistics of each episode
DIR/meta/tasks.jsonl           task texts and their numbers
DIR/meta/modality.json         groups of numbers for GR00T-H, tag JHU_IMERSE_DVRK_MONO
DIR/meta/README.md             description in the sections of Open-H
DIR/meta/recordings.json       ours: the recording of each episode
DIR/data/chunk-000/episode_000000.parquet
DIR/videos/chunk-000/observation.images.endoscope.left/episode_000000.mp4, and right
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from learning.datasets import open_h_meta
from learning.datasets.episode import Episode
from learning.datasets.pictures import EYES, Pair
from learning.datasets.statistics import PictureCounts, vector_statistics
from learning.datasets.video import Video
from schemas.errors import RecordingError

__all__ = ["OpenHWriter"]

_VIDEOS = tuple(f"observation.images.endoscope.{eye}" for eye in EYES)


class OpenHWriter:
    """A data set that grows by episodes, each in files of its own; whole after `close`."""

    def __init__(self, directory: Path, fps: int, size: tuple[int, int], first: Episode) -> None:
        """Begin in `directory`; all episodes have the columns of `first`, and pictures of `size`."""
        self._directory, self._fps, self._size, self._first = directory, fps, size, first
        self._tasks: dict[str, int] = {}
        self._lines: dict[str, list[dict[str, Any]]] = {"episodes": [], "episodes_stats": []}
        self._sources: list[dict[str, Any]] = []
        self.frames = 0
        """Number of frames of all episodes."""

    @property
    def episodes(self) -> int:
        """Number of episodes."""
        return len(self._sources)

    def add(self, episode: Episode, count: int, pairs: Iterator[Pair], source: Mapping[str, Any]) -> None:
        """Append the first `count` frames of an episode and their pictures.

        `source` is for `meta/recordings.json`. Raises RecordingError if columns differ from those of the
        first episode, or if pictures are missing.
        """
        self._require_columns(episode)
        number = self.episodes
        task = self._tasks.get(episode.task, len(self._tasks))
        pictures = self._write_videos(number, pairs, count)
        columns = self._columns(episode, count, number, task)
        file = self._file("data", number, "parquet")
        file.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(pa.table({name: _to_arrow(values) for name, values in columns.items()}), file)
        statistics = {
            name: vector_statistics(values.reshape(count, -1))
            for name, values in columns.items()
            if values.dtype.kind != "U"
        } | {key: one.statistics() for key, one in pictures.items()}
        kept = {name: {key: one[key] for key in open_h_meta.STATISTICS} for name, one in statistics.items()}
        self._tasks[episode.task] = task
        row = {"episode_index": number, "tasks": [episode.task], "length": count}
        self._lines["episodes"].append(row)
        self._lines["episodes_stats"].append({"episode_index": number, "stats": kept})
        self._sources.append({"episode_index": number, **source})
        self.frames += count

    def _require_columns(self, episode: Episode) -> None:
        first = self._first
        ours, others = (
            {name: columns for name, (columns, _) in one.meta.items()} | dict.fromkeys(one.texts, ("text",))
            for one in (first, episode)
        )
        if ours != others or episode.frame != first.frame:
            other = sorted({*ours} ^ {*others}) or [f"frame {episode.frame}"]
            raise RecordingError(
                f"'{episode.recording.file}' has other truths or frames than the first recording of the data"
                f" set ({', '.join(other)}): give it a data set of its own"
            )

    def _columns(self, episode: Episode, count: int, number: int, task: int) -> dict[str, NDArray[Any]]:
        frame = np.arange(count)
        return {
            "observation.state": episode.state[:count],
            "action": episode.action[:count],
            **{name: values[:count] for name, (_, values) in episode.meta.items()},
            **{name: np.full(count, text) for name, text in episode.texts.items()},
            "instruction.text": episode.instructions[:count],
            "timestamp": (frame / self._fps).astype(np.float32),
            "frame_index": frame.astype(np.int64),
            "episode_index": np.full(count, number, np.int64),
            "index": (self.frames + frame).astype(np.int64),
            "task_index": np.full(count, task, np.int64),
        }

    def _write_videos(self, number: int, pairs: Iterator[Pair], count: int) -> dict[str, PictureCounts]:
        videos = {key: Video(self._file(key, number, "mp4"), self._size, self._fps) for key in _VIDEOS}
        counts = {key: PictureCounts() for key in _VIDEOS}
        try:
            for pair in pairs:
                for key, picture in zip(_VIDEOS, pair, strict=True):
                    videos[key].add(picture)
                    counts[key].add(picture)
        finally:
            for video in videos.values():
                video.close()
        if (drawn := videos[_VIDEOS[0]].frames) != count:
            raise RecordingError(f"{drawn} pictures for {count} frames")
        return counts

    def _file(self, what: str, number: int, ending: str) -> Path:
        chunk = f"chunk-{number // open_h_meta.CHUNK:03d}"
        place = Path("data", chunk) if what == "data" else Path("videos", chunk, what)
        return self._directory / place / f"episode_{number:06d}.{ending}"

    def close(self) -> None:
        """Write the description of all episodes. May be called twice."""
        if not self.episodes:
            return
        meta = self._directory / "meta"
        meta.mkdir(exist_ok=True)
        tasks = [{"task_index": number, "task": text} for text, number in self._tasks.items()]
        for name, lines in (self._lines | {"tasks": tasks}).items():
            text = "".join(json.dumps(line) + "\n" for line in lines)
            (meta / f"{name}.jsonl").write_text(text, encoding="utf-8")
        counts = open_h_meta.Counts(self.episodes, self.frames, len(self._tasks))
        info = open_h_meta.info(self._first, self._fps, self._size, _VIDEOS, counts)
        contents: dict[str, Any] = {
            "info": info,
            "modality": open_h_meta.modality(info),
            "recordings": self._sources,
        }
        for name, content in contents.items():
            (meta / f"{name}.json").write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
        text = open_h_meta.readme(contents["info"], list(self._tasks))
        (meta / "README.md").write_text(text, encoding="utf-8")


def _to_arrow(values: NDArray[Any]) -> Any:
    """Return rows as a column: lists, or bare numbers and texts."""
    if values.ndim == 1:
        return pa.array(values.tolist() if values.dtype.kind == "U" else values)
    flat = pa.array(values.reshape(-1))
    return pa.FixedSizeListArray.from_arrays(flat, values.shape[1]) if values.shape[1] > 1 else flat
