"""The displayed surface of a soft body."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from engines.mujoco.pictures.skin_mesh import SkinMesh
from engines.tissue.meshing.grid import block
from schemas.vectors import Vector

SIZE = np.array([0.08, 0.06, 0.02])


def icosphere(radius: float) -> tuple[Vector, NDArray[np.int64]]:
    """A sphere of 42 nodes and 80 triangles, whose faces meet at 18 degrees and more."""
    from scipy.spatial import ConvexHull

    golden = (1.0 + np.sqrt(5.0)) / 2.0
    corners = np.array(
        [p for x in (-1.0, 1.0) for y in (-golden, golden) for p in ((0.0, x, y), (x, y, 0.0), (y, 0.0, x))]
    )
    sides = [
        (i, j)
        for i in range(12)
        for j in range(i)
        if np.isclose(np.linalg.norm(corners[i] - corners[j]), 2.0)
    ]
    nodes = np.concatenate([corners, [(corners[i] + corners[j]) / 2.0 for i, j in sides]])
    nodes *= radius / np.linalg.norm(nodes, axis=1, keepdims=True)
    triangles = ConvexHull(nodes).simplices.astype(np.int64)
    outward = (
        np.einsum(
            "fi,fi->f",
            np.cross(*(nodes[triangles[:, i]] - nodes[triangles[:, 0]] for i in (1, 2))),
            nodes[triangles[:, 0]],
        )
        > 0.0
    )
    return nodes, np.where(outward[:, None], triangles, triangles[:, ::-1])


def sides_of(vertices: Vector, faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """All directed sides by the points they join, shape (3 f, 6)."""
    return np.concatenate(
        [np.concatenate([vertices[faces[:, i]], vertices[faces[:, (i + 1) % 3]]], axis=1) for i in range(3)]
    )


def volume(vertices: Vector, faces: NDArray[np.int64]) -> float:
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return float(np.einsum("fi,fi->", np.cross(a, b), c) / 6.0)


def test_a_box_keeps_its_sharp_edges_and_flat_sides() -> None:
    mesh = block(SIZE, 100)
    skin = SkinMesh(mesh.nodes, mesh.triangles)
    vertices = skin.vertices(mesh.nodes)
    assert volume(vertices, skin.faces) == pytest.approx(SIZE.prod())
    a, b, c = (vertices[skin.faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    assert np.allclose(np.abs(normals).max(axis=1), 1.0)
    # every vertex belongs to one side of the box, so its normal is that side's
    for vertex in np.unique(skin.faces):
        assert np.ptp(normals[(skin.faces == vertex).any(axis=1)], axis=0).max() < 1e-9


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 4e-3))
def test_there_is_no_gap_however_it_is_bent(seed: int, most: float) -> None:
    mesh = block(SIZE, 60)
    skin = SkinMesh(mesh.nodes, mesh.triangles)
    vertices = skin.vertices(mesh.nodes + np.random.default_rng(seed).uniform(-most, most, mesh.nodes.shape))
    sides = np.round(sides_of(vertices, skin.faces), 12) + 0.0
    forth, back = (np.unique(sides[:, order], axis=0) for order in ([0, 1, 2, 3, 4, 5], [3, 4, 5, 0, 1, 2]))
    assert np.array_equal(forth, back)


@given(st.integers(0, 2**32 - 1))
def test_it_moves_with_the_body(seed: int) -> None:
    from scipy.spatial.transform import Rotation

    chance = np.random.default_rng(seed)
    turn, shift = Rotation.random(rng=chance).as_matrix(), chance.normal(size=3)
    nodes, triangles = icosphere(0.02)
    nodes = nodes + chance.uniform(-1e-3, 1e-3, nodes.shape)
    skin = SkinMesh(nodes, triangles)
    assert np.allclose(
        skin.vertices(nodes @ turn.T + shift), skin.vertices(nodes) @ turn.T + shift, atol=1e-12
    )


def test_a_sphere_becomes_rounder_and_keeps_its_nodes() -> None:
    nodes, triangles = icosphere(0.02)
    skin = SkinMesh(nodes, triangles)
    vertices = skin.vertices(nodes)
    assert len(skin.faces) == 4**3 * len(triangles)
    # Euler, for a closed surface whose vertices are all smooth
    assert len(vertices) == len(skin.faces) / 2 + 2
    assert set(map(tuple, vertices[:42].tolist())) == set(map(tuple, nodes.tolist()))
    flat = 0.5 * (nodes[triangles] + nodes[np.roll(triangles, -1, axis=1)])
    sag = 0.02 - np.linalg.norm(flat, axis=-1).min()
    assert np.abs(np.linalg.norm(vertices, axis=1) - 0.02).max() < 0.15 * sag


def test_where_a_sharp_edge_ends_the_surface_is_closed() -> None:
    nodes, triangles = icosphere(0.02)
    nodes[0] *= 1.6  # a spike: its own edges are sharp, those around it less so
    skin = SkinMesh(nodes, triangles)
    sides = np.round(sides_of(skin.vertices(nodes), skin.faces), 12) + 0.0
    assert set(map(tuple, sides.tolist())) == set(map(tuple, sides[:, [3, 4, 5, 0, 1, 2]].tolist()))
