"""Materials of a scene for Filament."""

from __future__ import annotations

import mujoco
import pytest

from engines.mujoco.place.dress import dress_scene


@pytest.fixture
def scene() -> mujoco.MjSpec:
    made = mujoco.MjSpec()
    for name in ("box", "board", "needle"):
        body = made.worldbody.add_body(name=name)
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.01, 0.01, 0.01])
    return made


def test_printed_marks_are_matt_and_needles_are_metal(scene: mujoco.MjSpec) -> None:
    dress_scene(scene, 0.0, "filmic", 0.0, ["box"])
    roughness = {geom.parent.name: scene.material(geom.material).roughness for geom in scene.geoms}
    assert roughness["box"] > 0.9 > roughness["board"] > roughness["needle"]


@pytest.mark.parametrize(("smoke", "density"), [(0.0, None), (0.5, 6.0)])
def test_smoke_is_an_extinction(scene: mujoco.MjSpec, smoke: float, density: float | None) -> None:
    dress_scene(scene, 0.0, "filmic", smoke)
    numbers = {number.name: number.data[0] for number in scene.numerics}
    assert numbers.get("filament.fog.density") == density
