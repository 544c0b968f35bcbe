"""A data set of Open-H that grows by the data sets of single episodes.

    DIR/.trocar             marks the directory; locked while the command runs
    DIR/demonstrations.json the settings
    DIR/parts/00007.json    how the episode with seed 7 ended; its data set is gone once it is taken up
    DIR/data, videos, meta  the data set, whole after each episode
    DIR/meta/dropped.jsonl  seeds without an episode, and why

An episode counts as taken up when its line stands in `meta/episodes.jsonl`, which is written last.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from learning.datasets import open_h_meta
from learning.datasets.statistics import vector_statistics
from learning.own_directory import MARKER, whole_file
from schemas.errors import ScenarioError

__all__ = ["Collection"]


class Collection:
    """The directory of the demonstrations of a scenario."""

    def __init__(self, directory: Path, settings: Mapping[str, Any]) -> None:
        """Begin in `directory`, which the caller has claimed, or go on there.

        Raises ScenarioError if the directory holds other demonstrations, or something else.
        """
        self.directory, self._meta = directory, directory / "meta"
        self.parts = directory / "parts"
        file = directory / "demonstrations.json"
        if file.exists():
            if json.loads(file.read_text("utf-8")) != settings:
                raise ScenarioError(
                    f"'{directory}' holds other demonstrations (see {file}): name a new directory, or repeat"
                    " the command that began it; only --episodes may grow"
                )
        elif any(path.name != MARKER for path in directory.iterdir()):
            raise ScenarioError(
                f"'{directory}' holds something else than demonstrations: name a new directory"
            )
        self.parts.mkdir(exist_ok=True)
        self._meta.mkdir(exist_ok=True)
        with whole_file(file) as part:
            part.write_text(json.dumps(settings, indent=2) + "\n", "utf-8")
        self._episodes = list(self._read("episodes"))
        self._frames = sum(one["length"] for one in self._episodes)
        self._tasks = {one["task"]: one["task_index"] for one in self._read("tasks")}

    @property
    def episodes(self) -> int:
        """Number of episodes."""
        return len(self._episodes)

    @property
    def frames(self) -> int:
        """Number of frames of all episodes."""
        return self._frames

    @property
    def dropped(self) -> dict[int, str]:
        """Reasons by seed of failed demonstrations."""
        return {one["seed"]: one["failure"] for one in self._read("dropped")}

    def place(self, seed: int) -> Path:
        """Return the place of the data set of one seed."""
        return self.parts / f"{seed:05d}"

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield the ends of all demonstrations so far."""
        for file in sorted(self.parts.glob("*.json")):
            yield json.loads(file.read_text("utf-8"))

    def take_up(self, row: Mapping[str, Any]) -> str:
        """Append a demonstration, or note its failure; return a remark, or nothing.

        A demonstration that is there already is left alone.
        """
        seed = row["seed"]
        if seed in {one["seed"] for one in self._episodes} or seed in self.dropped:
            return ""
        part = self.place(seed)
        failure = row["failure"] or self._append(part, row)
        if failure:
            self._add_line("dropped", {"seed": seed, "failure": failure})
        shutil.rmtree(part, ignore_errors=True)
        return f"seed {seed}: {failure}" if failure else ""

    def _append(self, part: Path, row: Mapping[str, Any]) -> str:
        """Append the data set in `part`; return why it does not fit, or nothing."""
        info = json.loads((part / "meta/info.json").read_text("utf-8"))
        if self._episodes:
            ours = json.loads((self._meta / "info.json").read_text("utf-8"))
            if ours["features"] != info["features"] or ours["frame"] != info["frame"]:
                return "its features differ from those of the first episode"
        (line,) = _read_lines(part / "meta/episodes.jsonl")
        (statistics,) = _read_lines(part / "meta/episodes_stats.jsonl")
        (source,) = json.loads((part / "meta/recordings.json").read_text("utf-8"))
        number, task = len(self._episodes), line["tasks"][0]
        new_task = task not in self._tasks
        index = self._tasks.setdefault(task, len(self._tasks))
        statistics["stats"] |= self._copy_rows(part, number, index)
        for key, feature in info["features"].items():
            if feature["dtype"] == "video":
                target = self._file(info["video_path"], number, key)
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(part / info["video_path"].format(**_numbers(0, key)), target)
        self._frames += line["length"]
        if new_task:
            self._add_line("tasks", {"task_index": index, "task": task})
        self._add_line("episodes_stats", statistics | {"episode_index": number})
        made = {key: source[key] for key in ("scenario", "pictures", "randomise") if key in source}
        made["trocar"] = source["versions"].get("trocar", "")
        self._add_line("sources", {"episode_index": number, **row, **made})
        entry = line | {"episode_index": number, "seed": row["seed"]}
        self._episodes.append(entry)
        self._describe(info)
        self._add_line("episodes", entry)
        return ""

    def _copy_rows(self, part: Path, number: int, task: int) -> dict[str, Any]:
        """Copy the rows with new indices; return the statistics of these."""
        table = pq.read_table(part / "data/chunk-000/episode_000000.parquet")
        count = table.num_rows
        columns = {
            "episode_index": np.full(count, number, np.int64),
            "index": self._frames + np.arange(count, dtype=np.int64),
            "task_index": np.full(count, task, np.int64),
        }
        for name, values in columns.items():
            table = table.set_column(table.column_names.index(name), name, pa.array(values))
        target = self._file("data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet", number)
        target.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(table, target)
        return {
            name: {key: one[key] for key in open_h_meta.STATISTICS}
            for name, one in ((name, vector_statistics(v.reshape(-1, 1))) for name, v in columns.items())
        }

    def _describe(self, info: Mapping[str, Any]) -> None:
        """Write `info.json`, `modality.json` and README for the episodes so far."""
        counts = open_h_meta.Counts(len(self._episodes), self._frames, len(self._tasks))
        whole = open_h_meta.with_counts(info, counts)
        for name, content in (("info", whole), ("modality", open_h_meta.modality(whole))):
            with whole_file(self._meta / f"{name}.json") as part:
                part.write_text(json.dumps(content, indent=2) + "\n", "utf-8")
        (self._meta / "README.md").write_text(open_h_meta.readme(whole, list(self._tasks)), "utf-8")

    def _file(self, path: str, number: int, key: str = "") -> Path:
        return self.directory / path.format(**_numbers(number, key))

    def _read(self, name: str) -> Iterator[dict[str, Any]]:
        file = self._meta / f"{name}.jsonl"
        return _read_lines(file) if file.exists() else iter(())

    def _add_line(self, name: str, line: Mapping[str, Any]) -> None:
        """Append a line; one with the same number that an interruption left is replaced."""
        key = "seed" if name == "dropped" else "task_index" if name == "tasks" else "episode_index"
        file = self._meta / f"{name}.jsonl"
        if name != "episodes" and any(one[key] == line[key] for one in self._read(name)):
            kept = [one for one in self._read(name) if one[key] != line[key]]
            text = "".join(json.dumps(one) + "\n" for one in kept)
            with whole_file(file) as part:
                part.write_text(text, "utf-8")
        with file.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps(line) + "\n")


def _numbers(number: int, key: str) -> dict[str, Any]:
    return {"episode_chunk": number // open_h_meta.CHUNK, "episode_index": number, "video_key": key}


def _read_lines(file: Path) -> Iterator[dict[str, Any]]:
    for line in file.read_text("utf-8").splitlines():
        yield json.loads(line)
