"""Truth of a recording at chosen times, with pictures of both eyes; and truth beside a LeRobotDataset.

DIR/truth/episode_000000/scene.json                classes and bodies
DIR/truth/episode_000000/left/000000/              a frame as `engines.mujoco.truth.files` writes it
"""

from __future__ import annotations

import json
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engines.mujoco.pictures.recorded_scene import RecordedScene
from engines.mujoco.truth.files import scene_json, write_frame
from engines.mujoco.truth.modality import Modality
from engines.mujoco.truth.recorded_truth import RecordedTruth, TruthFrame
from robots.dvrk.endoscope import EYES, Eye
from trocar import Recording

__all__ = ["RecordedScene", "Stereo", "open_scene", "open_truth", "stereo_frames", "write_truth"]


Looks = Literal["plain", "endoscope"]


class Stereo(NamedTuple):
    """Pictures and truth at a time, by eye."""

    pictures: Mapping[Eye, NDArray[np.uint8]]
    """Shape (height, width, 3), RGB."""
    truth: Mapping[Eye, TruthFrame]


def open_scene(
    recording: Recording, looks: Looks | None, randomise: int | None, *, recorded: bool, trust: bool
) -> RecordedScene:
    """Return the scene of a recording with the looks of its pictures.

    Args:
        recording: to be drawn.
        looks: of drawn pictures; None: plain, or as recorded.
        randomise: seed of differences of what is seen; None: as recorded.
        recorded: the pictures are those that the session has drawn.
        trust: read files that have changed since.
    """
    if looks is None:
        looks = _recorded_looks(recording) if recorded else "plain"
    return RecordedScene(recording, looks=looks, randomise=randomise, trust=trust)


def _recorded_looks(recording: Recording) -> Looks:
    specs = [one for one in recording.scenario().participants.values() if one.kind == "endoscope"]
    own = min(specs, key=lambda one: "view" in one.params, default=None)
    return "plain" if own is None or own.params.get("looks") != "endoscope" else "endoscope"


@contextmanager
def open_truth(scene: RecordedScene, size: tuple[int, int]) -> Generator[RecordedTruth]:
    """Draw the truth for stereo pictures of a recording, as `RecordedScene.stereo` has them."""
    bodies = scene.states.bodies_at(0)
    with RecordedTruth(scene.states, scene.stereo_camera(bodies, size), bodies) as truth:
        yield truth


def write_truth(
    directory: Path,
    truth: RecordedTruth,
    times_ns: Sequence[int],
    after_ns: int,
    modalities: frozenset[Modality],
) -> None:
    """Write the truth at `times_ns` into `directory`, which is made; `after_ns`: a frame after the last."""
    directory.mkdir(parents=True)
    (directory / "scene.json").write_text(json.dumps(scene_json(truth.bodies), indent=2) + "\n", "utf-8")
    frames = truth.frames(times_ns, EYES, after_ns if "flow" in modalities else None)
    for number, frame in enumerate(frames):
        for eye in EYES:
            place = directory / eye / f"{number:06d}"
            place.mkdir(parents=True)
            write_frame(place, frame[eye], truth.bodies, modalities)


def stereo_frames(
    scene: RecordedScene, truth: RecordedTruth, times_ns: Sequence[int], size: tuple[int, int]
) -> Iterator[Stereo]:
    """Yield pictures, drawn, and truth of both eyes at each of `times_ns`."""
    for pair, frame in zip(scene.stereo(times_ns, size), truth.frames(times_ns, EYES), strict=True):
        yield Stereo(dict(zip(EYES, pair, strict=True)), frame)
