"""An episode of a data set: the numbers of a recording at the times of its frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from engines.mujoco.truth.modality import Modality
from learning.datasets import open_h
from learning.datasets.columns import Columns, choose_columns, commanded_columns, measured_columns
from learning.datasets.instructions import instructions
from learning.datasets.tips import Tips
from schemas.errors import RecordingError
from schemas.keys import same_session_name
from schemas.scenario import Scenario
from trocar import Recording, recover

__all__ = ["Episode", "Wanted", "open_recording"]


@dataclass(frozen=True)
class Wanted:
    """Parts of each recording wanted in a data set."""

    fps: int = 25
    size: tuple[int, int] | None = None
    """Width and height of the pictures; None: as in the first recording, else 640 x 480."""
    tasks: Mapping[str, str] = field(default_factory=dict[str, str])
    """The robot's task in words by scenario; below an empty name: of all others; default: the description of
    each recording's scenario.
    """
    state: tuple[str, ...] = ()
    """Ports, or fields of ports; empty: measured joints of all arms."""
    action: tuple[str, ...] = ()
    """Likewise; empty: commanded joints of all arms."""
    format: Literal["lerobot-v3", "open-h", "coco", "bop"] = "lerobot-v3"
    """Layout of the files, and names of state and action."""
    looks: Literal["plain", "endoscope"] | None = None
    """Looks with which all pictures are drawn; None: recorded pictures where they fit, else plain."""
    randomise: int | None = None
    """Seed of the looks of the first episode, which counts up; None: as recorded."""
    truth: frozenset[Modality] = frozenset()
    """Modalities written beside the pictures."""


@dataclass(frozen=True)
class Episode:
    """The numbers of a recording, a row for each frame."""

    recording: Recording
    task: str
    times_ns: NDArray[np.int64]
    """Simulated times of the frames, shape (n,)."""
    state_names: tuple[str, ...]
    state: NDArray[np.float32]
    """The newest values at each frame, shape (n, len(state_names))."""
    action_names: tuple[str, ...]
    action: NDArray[np.float32]
    """Commands at the time of the next frame, shape (n, len(action_names))."""
    instructions: NDArray[np.str_]
    """What is to be done in each frame, in words, shape (n,)."""
    meta: Mapping[str, tuple[tuple[str, ...], NDArray[np.float32]]] = field(
        default_factory=dict[str, "tuple[tuple[str, ...], NDArray[np.float32]]"]
    )
    """Truths of the scene by feature: names of columns, and the newest values at each frame."""
    texts: Mapping[str, str] = field(default_factory=dict[str, str])
    """Texts by feature, the same in all frames."""
    frame: str = ""
    """Reference frame of poses; empty for joints."""

    @classmethod
    def of(cls, recording: Recording, wanted: Wanted) -> Episode:
        """Return the numbers of `recording`, from when all are known until a number of the state ends.

        Each frame has its action, a frame later. Raises RecordingError if the recording lacks numbers, or
        lasts for less than a frame.
        """
        tips = Tips(recording) if wanted.format == "open-h" else None
        if tips is not None:
            state, action = open_h.state_columns(tips), open_h.action_columns(tips)
        else:
            state = choose_columns(recording, wanted.state) if wanted.state else measured_columns(recording)
            action = (
                choose_columns(recording, wanted.action) if wanted.action else commanded_columns(recording)
            )
        truths = {} if tips is None else open_h.meta_columns(recording, tips)
        for one in (*state, *action):
            if not len(one.times_ns):
                raise RecordingError(f"'{recording.file}': nothing is recorded of '{one.port}'")
        first = max(int(one.times_ns[0]) for one in (*state, *action))
        last = min(int(one.times_ns[-1]) for one in state)
        count = (last - first) * wanted.fps // 1_000_000_000
        if count < 1:
            raise RecordingError(
                f"'{recording.file}' lasts for less than a frame: {max(0, last - first) * 1e-9:g} s at"
                f" {wanted.fps} frames a second"
            )
        times_ns = first + np.arange(count + 1) * 1_000_000_000 // wanted.fps
        task = _task(recording.scenario(), wanted.tasks)
        return cls(
            recording=recording,
            task=task,
            times_ns=times_ns[:-1],
            state_names=_names(state),
            state=np.hstack([one.at(times_ns[:-1]) for one in state]),
            action_names=_names(action),
            # an action leads from one frame to the next: it comes after the picture that it answers
            action=np.hstack([one.at(times_ns[1:]) for one in action]),
            instructions=instructions(recording, times_ns[:-1], task),
            meta={name: (one.names, one.at(times_ns[:-1])) for name, one in truths.items()},
            texts={} if tips is None else open_h.tools(tips),
            frame="" if tips is None else tips.frame,
        )


def _task(scenario: Scenario, tasks: Mapping[str, str]) -> str:
    own = (task for name, task in tasks.items() if same_session_name(name, scenario.name))
    return next(own, "") or tasks.get("") or " ".join(scenario.description.split()) or scenario.name


def _names(columns: Sequence[Columns]) -> tuple[str, ...]:
    return tuple(name for one in columns for name in one.names)


def open_recording(path: Path, scratch: Path) -> tuple[Recording, bool]:
    """Open a recording; return also whether the recording was cut short and saved in `scratch`.

    `scratch` then has the readable part. Raises RecordingError if nothing can be read.
    """
    try:
        return Recording(path), False
    except RecordingError as error:
        try:
            saved = recover(path, scratch / "recovered")
        except RecordingError:
            raise error from None
        if not saved.messages:
            raise RecordingError(f"'{path}' was cut short before anything was recorded") from error
        return Recording(saved.path), True
