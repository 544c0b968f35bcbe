"""Pictures by Filament: structure, not pixels of a driver."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from engines.mujoco.model import build
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.endoscope_scene import EndoscopeScene
from engines.mujoco.pictures.filament import backend
from engines.mujoco.pictures.soft_body import SoftBody
from tests.engines.mujoco.pictures.test_changed_skin import film_of, nodes_of
from tests.engines.tissue.cut_block import CutBlock

SIZE = np.array([0.08, 0.06, 0.02])
WIDTH, HEIGHT, DISTANCE = 120, 96, 0.06
SCENE = {
    "arms": {"PSM1": {"position": [0.0, 0.0, 0.3]}},
    "view": {"position": [0.0, 0.0, DISTANCE], "target": [0.0, 1e-4, 0.0]},
    "width": WIDTH,
    "height": HEIGHT,
    "skins": {"tissue": {}},
    "place": "none",
    "baseline": 0.0,
    "sensor": {"noise": 0.0, "vignette": 0.0},
}

Picture = NDArray[np.float64]


class Shown:
    """A block that is drawn wherever its nodes are."""

    def __init__(self, scene: EndoscopeScene, body: SoftBody, block: CutBlock, qpos: Picture) -> None:
        self._scene, self._body, self.block, self._qpos = scene, body, block, qpos

    def draw(self, nodes: Picture, film: NDArray[np.int64] | None = None) -> Picture:
        liquid = None if film is None else film_of(film)
        self._body.accept(nodes_of(nodes), self.block.surface.change("tissue", 0), liquid)
        return self._scene.draw(self._qpos)[0].astype(float)


@pytest.fixture(scope="module")
def shown() -> Iterator[Shown]:
    found = backend.find()
    if not found.name:
        pytest.skip(f"no Filament: {found.detail}")
    params = EndoscopeParams.model_validate(SCENE)
    block, body = CutBlock(SIZE, 250), SoftBody("tissue/nodes", may_change=True, may_be_wet=True)
    body.accept(nodes_of(block.mesh.nodes, block.mesh.triangles))
    scene = EndoscopeScene(params, found, {"tissue": body})
    yield Shown(scene, body, block, build(params).qpos0.copy())
    scene.close()


def details(picture: Picture) -> Picture:
    """Return brightness without its broad slopes, shape (height, width)."""
    grey = picture.mean(axis=2)
    broad = sum(np.roll(grey, (i, j), (0, 1)) for i in range(-4, 5) for j in range(-4, 5)) / 81.0
    return grey - broad


def likeness(one: Picture, other: Picture) -> float:
    middle = slice(HEIGHT // 4, -HEIGHT // 4), slice(WIDTH // 4, -WIDTH // 4)
    return float(np.corrcoef(one[middle].ravel(), other[middle].ravel())[0, 1])


@pytest.mark.long
def test_pictures_of_tissue(shown: Shown) -> None:
    """One scene for all: the first picture takes seconds."""
    nodes = shown.block.mesh.nodes
    first = shown.draw(nodes)
    assert first.mean() > 40.0  # neither black nor burnt out
    assert (first.max(axis=2) > 250.0).mean() < 0.2
    assert first[..., 0].mean() > first[..., 2].mean() + 15.0  # flesh
    assert np.abs(details(first)).mean() > 0.5  # textured
    pixel = 2.0 * DISTANCE * np.tan(0.5 * EndoscopeParams.model_validate(SCENE).field_of_view) / WIDTH
    moved = shown.draw(nodes + np.array([10 * pixel, 0.0, 0.0]))
    followed = np.roll(moved, -10, axis=1)
    # the texture goes with the tissue, highlights stay with the lamp
    assert likeness(details(followed), details(first)) > likeness(details(moved), details(first)) + 0.2
    shown.block.cut(0.012)
    opened = shown.draw(shown.block.part(0.01))
    strip = opened[HEIGHT // 2 - 5 : HEIGHT // 2 + 5, WIDTH // 2 - 4 : WIDTH // 2 + 4]
    assert strip[..., 0].mean() > 2.0 * strip[..., 1].mean()  # raw inside
    again = shown.draw(shown.block.part(0.01))
    assert np.abs(again - opened).mean() < 10.0  # the light still follows
    parted = shown.block.part(0.01)
    wet = shown.draw(parted, np.where(parted[:, 0] > 0.01, 200, 0))
    left, right = wet[HEIGHT // 2, WIDTH // 8], wet[HEIGHT // 2, -WIDTH // 8]
    assert right[0] > 3.0 * right[1]  # deep blood
    assert left[1] > 2.0 * right[1]
    dry = shown.draw(parted, np.zeros(len(parted), np.int64))
    assert dry[HEIGHT // 2, -WIDTH // 8, 1] > 2.0 * right[1]


class Allocated(ctypes.Structure):
    """`struct mallinfo2` of glibc (mallinfo(3))."""

    _fields_ = [
        (name, ctypes.c_size_t)
        for name in [
            "arena",
            "ordblks",
            "smblks",
            "hblks",
            "hblkhd",
            "usmblks",
            "fsmblks",
            "uordblks",
            "fordblks",
            "keepcost",
        ]
    ]


@pytest.mark.long
@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallinfo2"), reason="no glibc")
def test_a_picture_keeps_no_memory(shown: Shown) -> None:
    count = ctypes.CDLL(None).mallinfo2
    count.restype = Allocated
    nodes = shown.block.part(0.0)
    taken: list[int] = []
    for pictures in (3, 10):
        for _ in range(pictures):
            shown.draw(nodes)
        taken.append(count().uordblks + count().hblkhd)
    assert taken[1] - taken[0] < 10 * 4 * nodes.nbytes // 3


@pytest.mark.long
def test_a_camera_that_was_inside_an_organ_sees_it_again(shown: Shown) -> None:
    nodes = shown.block.part(0.0)
    shown.draw(nodes + np.array([0.02, 0.0, DISTANCE]))
    for _ in range(8):  # the light follows
        outside = shown.draw(nodes)
    assert 40.0 < outside.mean() < 220.0
