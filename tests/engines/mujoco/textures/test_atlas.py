"""Unfolding of a surface."""

from __future__ import annotations

import numpy as np
import pytest

from engines.mujoco.textures.atlas import Atlas, picture_side
from engines.mujoco.textures.noise import Noise
from engines.mujoco.textures.surface import Surface
from engines.tissue.organs.params import OrganParams

PIXELS = 256


def organ(shape: str) -> tuple[np.ndarray, np.ndarray]:
    mesh = OrganParams.model_validate({"shape": shape, "nodes": 200}).rest
    return mesh.nodes, mesh.triangles.astype(np.int64)


def place_as_colour(_: Noise, points: np.ndarray) -> Surface:
    flat = np.zeros(len(points), np.float32)
    return Surface(0.5 + 2.0 * points, flat, flat)


@pytest.mark.parametrize("shape", ["colon", "liver-lobe", "kidney-with-adrenal"])
def test_every_point_finds_its_place_in_the_picture(shape: str) -> None:
    nodes, triangles = organ(shape)
    atlas = Atlas(nodes, triangles, PIXELS)
    picture = atlas.paint(place_as_colour, Noise(1)).colour
    middles = nodes[triangles].mean(axis=1)
    uv = atlas.uv(middles, atlas.chart)
    assert uv.min() > 0.0
    assert uv.max() < 1.0
    column, row = np.floor(uv * PIXELS).astype(int).T
    found = (picture[row, column] / 255.0 - 0.5) / 2.0
    assert np.abs(found - middles).max() < 3.0 * atlas.texel + 2e-3  # colours have steps of 2 mm


def test_charts_are_right_handed_and_face_outwards() -> None:
    nodes, triangles = organ("colon")
    atlas = Atlas(nodes, triangles, PIXELS)
    u, v, normal = atlas.axes.transpose(1, 0, 2)
    assert np.allclose(np.cross(u, v), normal)
    a, b, c = (nodes[triangles[:, i]] for i in range(3))
    outward = np.cross(b - a, c - a)
    assert (np.einsum("fj,fj->f", outward, normal[atlas.chart]) > 0.0).all()


def test_a_single_triangle_is_unfolded() -> None:
    atlas = Atlas(np.eye(3), np.array([[0, 1, 2]]), 32)
    assert atlas.chart.tolist() == [0]
    assert atlas.paint(place_as_colour, Noise(1)).colour.shape == (32, 32, 3)


def test_two_hundred_organs_share_the_memory_of_thirty_two() -> None:
    assert picture_side(1) == picture_side(32) == 1024
    assert picture_side(33) == 512
    assert 200 * picture_side(200) ** 2 <= 32 * 1024**2
    assert picture_side(100_000) == 128
