"""Makes a data set of recordings, in turn; an unusable recording is left out with a reason."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from learning.datasets.episode import Episode, Wanted, open_recording
from learning.datasets.open_h_writer import OpenHWriter
from learning.datasets.pictures import DEFAULT_SIZE, recorded_size, stereo
from learning.datasets.truth import RecordedScene, open_scene, open_truth, write_truth
from learning.datasets.writer import Writer
from schemas.errors import RecordingError, SessionError, TrustError
from schemas.readable import counted
from trocar import Recording

__all__ = ["Conversion"]

OPEN_H_SIZE = (960, 540)
"""Size of Open-H's pictures of a dVRK (JHU)."""


class Conversion:
    """A data set in the making."""

    def __init__(self, directory: Path, wanted: Wanted, *, trust: bool = False) -> None:
        """Begin a data set with the `wanted` parts of each recording; `directory` holds no data set.

        `trust` allows drawn scenes of changed files.
        """
        self._directory, self._wanted, self._trust = directory, wanted, trust
        self._writer: Writer | OpenHWriter | None = None
        self._size = wanted.size
        self.tasks: dict[str, int] = {}
        """Number of episodes of each task."""
        self.tasks_without_recording = sorted(wanted.tasks.keys() - {""})
        """Scenarios with a task of their own, and without an episode."""
        self.left_out = 0
        """Unusable recordings."""
        self.is_whole = False
        """Whether the files are finished, with an episode at least."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finish the files, whatever ended the conversion: the episodes so far are a whole data set.

        But for a full disk: files cannot be finished there.
        """
        if self._writer is not None and not isinstance(error, OSError):
            self._writer.close()
            self.is_whole = self._writer.episodes > 0

    def add(self, path: Path) -> str:
        """Append the recording at `path`; return a remark, or nothing.

        Raises TrocarError without OpenGL.
        """
        try:
            with TemporaryDirectory() as scratch:
                try:
                    recording, cut_short = open_recording(path, Path(scratch))
                except OSError as error:
                    raise RecordingError(f"'{path}' cannot be opened: {error}") from error
                seconds = self._add(path, recording)
        except (RecordingError, TrustError, SessionError) as error:  # the last of unfit soft bodies
            self.left_out += 1
            return f"left out: {error}"
        return f"'{path}' was cut short: its first {seconds:g} s are taken" if cut_short else ""

    def _add(self, path: Path, recording: Recording) -> float:
        """Append a recording; return the episode's length, s."""
        wanted = self._wanted
        episode = Episode.of(recording, wanted)
        size = self._size or self._default_size(recording)
        seed = None if wanted.randomise is None else wanted.randomise + sum(self.tasks.values())
        pictures = stereo(
            recording,
            episode.times_ns,
            wanted.fps,
            size,
            looks=wanted.looks,
            randomise=seed,
            trust=self._trust,
        )
        if self._writer is None:
            kind = OpenHWriter if wanted.format == "open-h" else Writer
            self._writer = kind(self._directory, wanted.fps, size, episode)
            self._size = size
        source: dict[str, Any] = {
            "recording": str(path.resolve()),
            "scenario": recording.scenario().name,
            "first_frame_s": int(episode.times_ns[0]) / 1e9,
            "pictures": "recorded" if pictures.recorded else "drawn",
            **({} if seed is None else {"randomise": seed}),
            "versions": recording.versions(),
        }
        self._writer.add(episode, pictures.count, pictures.pairs, source)
        if wanted.truth:
            scene = open_scene(recording, wanted.looks, seed, recorded=pictures.recorded, trust=self._trust)
            self._write_truth(scene, self._writer.episodes - 1, episode.times_ns[: pictures.count], size)
        if (scenario := recording.scenario().name) in self.tasks_without_recording:
            self.tasks_without_recording.remove(scenario)
        self.tasks[episode.task] = self.tasks.get(episode.task, 0) + 1
        return pictures.count / wanted.fps

    def _default_size(self, recording: Recording) -> tuple[int, int]:
        if self._wanted.format == "open-h":
            return OPEN_H_SIZE
        return recorded_size(recording) or DEFAULT_SIZE

    def _write_truth(
        self, scene: RecordedScene, episode: int, times_ns: NDArray[np.int64], size: tuple[int, int]
    ) -> None:
        """Write the truth of an episode at the times of its frames, shape (n,)."""
        place = self._directory / "truth" / f"episode_{episode:06d}"
        after_ns = int(times_ns[-1]) + 1_000_000_000 // self._wanted.fps
        with open_truth(scene, size) as truth:
            write_truth(place, truth, times_ns.tolist(), after_ns, self._wanted.truth)

    def summary(self) -> str:
        """Return a summary of the data set, in a line. Raises RecordingError if nothing was made."""
        if self._writer is None or not self._writer.episodes:
            raise RecordingError("no recording could be used, so there is no data set")
        count, left_out = self._writer.episodes, f", {self.left_out} left out" if self.left_out else ""
        return f"{counted(count, 'episode')}, {counted(self._writer.frames, 'frame')}{left_out}"
