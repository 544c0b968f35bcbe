"""A picture of a recording with its truth, in a directory."""

from __future__ import annotations

from pathlib import Path

from PIL import Image

from engines.mujoco.pictures.recorded_scene import Camera, Point, RecordedScene
from engines.mujoco.truth.files import scene_json, write_frame
from engines.mujoco.truth.modality import Modality
from engines.mujoco.truth.recorded_truth import RecordedTruth
from robots.dvrk.endoscope import Eye

__all__ = ["write_truth"]


def write_truth(
    scene: RecordedScene,
    directory: Path,
    modalities: frozenset[Modality],
    time_ns: int,
    step_ns: int,
    camera: Camera,
    size: tuple[int, int],
    position: Point | None = None,
    target: Point | None = None,
) -> None:
    """Write `picture.png` and the truth beside it into `directory`, which is made.

    Args:
        scene: of a recording.
        directory: for the files.
        modalities: to be written.
        time_ns: simulated time of the picture.
        step_ns: time from the picture to the one to which the flow leads.
        camera: `left` or `right` of the endoscope, or `overview`.
        size: width and height, pixels.
        position: of the overview; see `RecordedScene.pictures`.
        target: of the overview.

    Raises what `RecordedScene.pictures` raises, and OSError.
    """
    bodies = scene.states.bodies_at(time_ns)
    params = scene.camera(bodies, camera, size, position, target)
    eye: Eye = "right" if camera == "right" else "left"
    picture = scene.picture(time_ns, camera, size, position, target)
    directory.mkdir(parents=True, exist_ok=True)
    Image.fromarray(picture).save(directory / "picture.png")
    with RecordedTruth(scene.states, params, bodies) as truth:
        after_ns = time_ns + step_ns if "flow" in modalities else None
        frame = next(truth.frames([time_ns], (eye,), after_ns))[eye]
        write_frame(directory, frame, truth.bodies, modalities, scene_json(truth.bodies))
