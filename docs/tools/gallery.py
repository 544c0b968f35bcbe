"""Draw pictures and films of docs/gallery.md: `make gallery`, or `python docs/tools/gallery.py [NAME...]`.

Each scenario runs, short where that shows enough, into build/gallery, unless its recording is there; each
shot is drawn from the recording in a process of its own. `--runs` runs the scenarios and draws nothing.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
PICTURES, RECORDINGS = ROOT / "docs" / "pictures" / "gallery", ROOT / "build" / "gallery"
FILM_PER_S = 10
LARGEST_FILM = 3_000_000
"""Bytes; a larger film is encoded again with less quality."""

Point = tuple[float, float, float]


class Shot(NamedTuple):
    """A picture, or a film, of a scenario."""

    name: str
    scenario: str
    until: float
    """Simulated seconds of the run."""
    start: float
    """Simulated time of the picture, or of a film's first picture, s."""
    end: float | None = None
    """Simulated time of a film's last picture, s; None: a picture."""
    speed: float = 1.0
    """Simulated seconds in a second of a film."""
    camera: Literal["overview", "left", "both"] = "left"
    """both: the pictures of both eyes, side by side."""
    looks: Literal["plain", "endoscope"] = "endoscope"
    size: tuple[int, int] = (640, 512)
    position: Point | None = None
    target: Point | None = None

    @property
    def file(self) -> Path:
        """The file of the shot."""
        return PICTURES / f"{self.name}.{'jpg' if self.end is None else 'webp'}"

    @property
    def recording(self) -> Path:
        """The recording of the run."""
        return RECORDINGS / f"{self.scenario}-{self.until:g}s"


_FILM, _EYE = (480, 384), (400, 320)
_NEAR, _TABLE = (0.075, -0.1, 0.085), (0.0, -0.008, 0.048)
"""Where a camera stands, and looks at, beside the needle of `pick` and `hand-over`, m."""
SHOTS = (
    Shot("clip-and-cut", "clip-and-cut", 58.0, 1.0, 53.5, 5.0, camera="both", size=_EYE),
    Shot("cart", "cart", 2.0, 1.0, camera="overview", looks="plain"),
    Shot("teleop", "teleop", 8.0, 4.0),
    Shot("palpation", "palpation", 8.0, 5.0, camera="overview"),
    Shot("retraction", "retraction", 12.0, 1.0, 11.0, 2.0, size=_FILM),
    Shot("colon-grasp", "colon-grasp", 8.0, 0.5, 7.5, 1.5, size=_FILM),
    Shot(
        "caliper",
        "caliper",
        5.0,
        4.0,
        camera="overview",
        position=(0.14, -0.1, 0.085),
        target=(0.014, 0.0, 0.0),
    ),
    Shot("cut", "cut", 10.5, 2.0, 10.0, 1.5, size=_FILM),
    Shot("dissect", "dissect", 24.0, 2.0, 23.5, 4.0, size=_FILM),
    Shot("suturing", "suturing", 30.0, 4.0, 28.0, 5.0, size=_FILM),
    Shot("pick", "pick", 11.0, 4.0, camera="overview", position=_NEAR, target=_TABLE),
    Shot("hand-over", "hand-over", 11.0, 7.0, camera="overview", position=_NEAR, target=_TABLE),
    Shot("rolling", "rolling", 4.0, 2.0, camera="overview"),
    Shot("needle-tracking", "needle-tracking", 8.0, 5.0),
    Shot("visual-servoing", "visual-servoing", 6.0, 5.5),
    Shot("peg-board", "peg-board", 14.0, 1.0, 13.5, 2.5, size=_FILM),
    Shot("pick-and-place", "pick-and-place", 16.0, 1.0, 15.0, 3.0, size=_FILM),
    Shot("browser", "browser", 2.0, 1.0),
)


def run(shot: Shot) -> None:
    """Run the scenario of a shot, unless its recording is there."""
    if shot.recording.exists():
        return
    changes = (f"duration={shot.until:g} s", "pace=fast")
    command = [sys.executable, "-P", "-m", "trocar", "run", shot.scenario, "--record", str(shot.recording)]
    try:
        subprocess.run(
            [*command, *(part for one in changes for part in ("--set", one))], check=True, cwd=ROOT
        )
    except BaseException:
        shutil.rmtree(shot.recording, ignore_errors=True)  # half a recording would be drawn the next time
        raise


def draw(shot: Shot) -> int:
    """Draw a shot; return the bytes of its file."""
    from engines.mujoco.pictures.recorded_scene import RecordedScene
    from hub.recording.recording import Recording

    scene = RecordedScene(Recording(shot.recording), looks=shot.looks)
    last = shot.start if shot.end is None else shot.end
    step_ns = round(shot.speed * 1e9 / FILM_PER_S)
    times = range(round(shot.start * 1e9), round(last * 1e9) + 1, step_ns)
    if shot.camera == "both":
        drawn = (np.hstack(eyes) for eyes in scene.stereo(times, shot.size))
    else:
        drawn = scene.pictures(times, shot.camera, shot.size, shot.position, shot.target)
    pictures = [Image.fromarray(one) for one in drawn]
    shot.file.parent.mkdir(parents=True, exist_ok=True)
    if shot.end is None:
        pictures[0].save(shot.file, quality=88)
        return shot.file.stat().st_size
    for quality in (70, 50, 30):
        _save_film(shot.file, pictures, quality)
        if shot.file.stat().st_size < LARGEST_FILM:
            break
    return shot.file.stat().st_size


def _save_film(file: Path, pictures: Sequence[Image.Image], quality: int) -> None:
    frame_ms = 1000 // FILM_PER_S
    pictures[0].save(
        file, save_all=True, append_images=pictures[1:], duration=frame_ms, loop=0, quality=quality, method=4
    )


def main() -> None:
    """Draw the shots asked for, by default all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="names of shots; default: all")
    parser.add_argument("--runs", action="store_true", help="run the scenarios, and draw nothing")
    asked = parser.parse_args()
    if unknown := set(asked.names) - {shot.name for shot in SHOTS}:
        parser.error(f"no shot {', '.join(sorted(unknown))}; there are {', '.join(s.name for s in SHOTS)}")
    for shot in (one for one in SHOTS if not asked.names or one.name in asked.names):
        run(shot)
        if asked.runs:
            continue
        # a renderer belongs to its process, which a driver may end
        with ProcessPoolExecutor(1, get_context("spawn")) as pool:
            size = pool.submit(draw, shot).result()
        print(f"{shot.file.relative_to(ROOT)}: {size / 1e6:.2f} MB", flush=True)


if __name__ == "__main__":
    main()
