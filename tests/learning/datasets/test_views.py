"""The pictures of a data set show the tips of all instruments, in every demonstration."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

import trocar
from engines.mujoco.pictures import endoscope_scene, opengl
from engines.mujoco.pictures.recorded_scene import RecordedScene
from robots.dvrk.endoscope import StereoCamera
from robots.transform import inverse_transform
from schemas.vectors import Vector

FRAMES = 40
WORK_M = 1e-3
"""A tip that moves no farther does not take part."""
FAST = {"pick": "3 s", "hand-over": "8 s"}
SLOW = {
    "pick-and-place": "4 s",
    "peg-board": "4 s",
    "peg-board-fls": "4 s",
    "peg-board-surrol": "4 s",
    "suturing": "5 s",
    "needle-tracking": "3 s",
    "rolling": "3 s",
    "retraction": "4 s",
    "colon-grasp": "4 s",
    "caliper": "3 s",
    "dissect": "5 s",
}
"""Simulated time of each demonstration, enough for the work of every instrument to begin."""


class Projection:
    """A renderer that notes the places of the tips: in the world, and whether in the left picture."""

    places: ClassVar[defaultdict[str, list[Vector]]] = defaultdict(list)
    seen: ClassVar[defaultdict[str, list[bool]]] = defaultdict(list)

    def __init__(self, model: Any, camera: StereoCamera, *_: object, **__: object) -> None:
        sites = [model.site(i) for i in range(model.nsite)]
        self._tips = [site for site in sites if site.name.startswith("PSM") and site.name.endswith("/tip")]
        self._half = np.tan(0.5 * camera.field_of_view) * np.array([1.0, camera.height / camera.width])
        self._blank = np.zeros((camera.height, camera.width, 3), np.uint8)

    def render(self, data: Any, pose: Vector, _: object) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        for tip in self._tips:
            place: Vector = data.site_xpos[tip.id].copy()
            x, y, z = (inverse_transform(pose) @ np.append(place, 1.0))[:3]
            self.places[tip.name].append(place)
            self.seen[tip.name].append(z > 0 and bool((abs(np.array([x, y])) < z * self._half).all()))
        return self._blank, self._blank

    def close(self) -> None:
        """Nothing is held."""


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "duration"),
    [*FAST.items(), *(pytest.param(*row, marks=pytest.mark.release) for row in SLOW.items())],
)
def test_every_working_tip_is_in_the_pictures(
    name: str, duration: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trocar.run(name, set={"duration": duration}, record=tmp_path / "run", one_host=True)
    monkeypatch.setattr(endoscope_scene, "StereoRenderer", Projection)
    monkeypatch.setattr(opengl, "find", lambda: SimpleNamespace(name="none", detail=""))
    Projection.places.clear()
    Projection.seen.clear()
    recording = trocar.Recording(tmp_path / "run")
    times_ns = np.linspace(0, recording.duration_ns, FRAMES, dtype=np.int64)
    for _ in RecordedScene(recording, looks="plain").stereo(times_ns.tolist(), (320, 240)):
        pass
    assert Projection.places, "what draws is another renderer"
    working = [tip for tip, places in Projection.places.items() if np.ptp(places, axis=0).max() > WORK_M]
    for tip in working or Projection.places:  # the rolling jaw works with its tip at rest
        assert np.mean(Projection.seen[tip]) > 0.15, f"{tip} is hardly in the pictures of {name}"
