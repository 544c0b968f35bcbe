"""Makes a data set of annotated pictures, in COCO's or BOP's layout, of recordings in turn."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, Self

from learning.datasets.annotations import Annotations
from learning.datasets.bop import Bop
from learning.datasets.coco import Coco
from learning.datasets.episode import Wanted, open_recording
from learning.datasets.pictures import DEFAULT_SIZE, recorded_size
from learning.datasets.truth import open_scene, open_truth, stereo_frames
from schemas.errors import RecordingError, SessionError, TrustError
from schemas.readable import counted
from trocar import Recording

__all__ = ["Annotated"]

_LAYOUTS: dict[str, type[Annotations]] = {"coco": Coco, "bop": Bop}


class Annotated:
    """A data set of annotated pictures in the making; the counterpart of `Conversion`."""

    def __init__(self, directory: Path, wanted: Wanted, *, trust: bool = False) -> None:
        """Begin in `directory`, which holds no data set; `trust` allows scenes of changed files."""
        self._set = _LAYOUTS[wanted.format](directory)
        self._wanted, self._trust, self._size = wanted, trust, wanted.size
        self.tasks: dict[str, int] = {}
        """Nothing: pictures have no task."""
        self.tasks_without_recording: list[str] = []
        self.left_out = 0
        """Unusable recordings."""
        self.is_whole = False
        """Whether the files are finished, with a frame at least."""
        self._recordings = self._frames = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finish the files, whatever ended the conversion, but for a full disk."""
        if not isinstance(error, OSError):
            self._set.close()
            self.is_whole = self._frames > 0

    def add(self, path: Path) -> str:
        """Append the recording at `path`; return a remark, or nothing. Raises TrocarError without OpenGL."""
        try:
            with TemporaryDirectory() as scratch:
                try:
                    recording, cut_short = open_recording(path, Path(scratch))
                except OSError as error:
                    raise RecordingError(f"'{path}' cannot be opened: {error}") from error
                self._add(path, recording)
        except (RecordingError, TrustError, SessionError) as error:  # the last of unfit soft bodies
            self.left_out += 1
            return f"left out: {error}"
        return f"'{path}' was cut short: its readable part is taken" if cut_short else ""

    def _add(self, path: Path, recording: Recording) -> None:
        size = self._size or recorded_size(recording) or DEFAULT_SIZE
        times_ns = list(range(0, recording.duration_ns + 1, 1_000_000_000 // self._wanted.fps))
        source: dict[str, Any] = {"recording": str(path.resolve()), "scenario": recording.scenario().name}
        wanted = self._wanted
        seed = None if wanted.randomise is None else wanted.randomise + self._recordings
        if seed is not None:
            source |= {"randomise": seed}
        scene = open_scene(recording, wanted.looks, seed, recorded=False, trust=self._trust)
        with open_truth(scene, size) as truth:
            self._set.begin(truth, source)
            for stereo in stereo_frames(scene, truth, times_ns, size):
                self._set.add(truth, stereo)
                self._frames += 1
        self._size, self._recordings = size, self._recordings + 1

    def summary(self) -> str:
        """Return a summary of the data set, in a line. Raises RecordingError if nothing was made."""
        if not self._frames:
            raise RecordingError("no recording could be used, so there is no data set")
        left_out = f", {self.left_out} left out" if self.left_out else ""
        return (
            f"{counted(self._recordings, 'recording')}, {counted(self._frames, 'stereo picture')}{left_out}"
        )
