"""Rings of the inner wall of a hollow mesh of any kind."""

import numpy as np
import pytest

from engines.tissue.meshing.tet_mesh import TetMesh
from engines.tissue.organs.inner_wall import wall_around, wall_of_rings
from engines.tissue.organs.tube import TubeParams, tube_shape

TUBE = TubeParams(length=0.04, diameter=5e-3, wall=1e-3)
LINE = np.array([[-0.02, 0.0, 0.0], [0.0, 0.0, 0.0], [0.02, 0.0, 0.0]])


def mesh():
    return tube_shape(TUBE).mesh(600)


def bent(points, radius=0.03):
    """Bend points along x about an axis along y, `radius` (m) above them."""
    angle, off = points[:, 0] / radius, radius - points[:, 2]
    return np.stack([off * np.sin(angle), points[:, 1], radius - off * np.cos(angle)], axis=1)


def check(found, known):
    on_wall = np.zeros(len(found.ring_of), bool)
    on_wall[known] = True
    assert (on_wall == (found.ring_of >= 0)).all()
    assert found.rings.shape[1] % 2 == 0
    assert on_wall[found.rings].all()
    assert found.diameters == pytest.approx(5e-3, rel=0.03)


def test_the_rings_of_a_tube_are_found_again_around_its_line():
    whole, known = mesh(), TUBE.rings(600)
    check(wall_around(whole, LINE), known)
    exact = wall_of_rings(whole, known, TUBE.diameter)
    assert exact.ring_of[known[3, 4]] == 3
    assert exact.sector_of[known[3, 4]] == 4


def test_the_rings_of_a_bent_tube_with_shuffled_nodes_follow_its_line():
    whole, known = mesh(), TUBE.rings(600)
    order = np.random.default_rng(1).permutation(len(whole.nodes))
    place = np.argsort(order)
    turned = TetMesh(bent(whole.nodes)[order], place[whole.tetrahedra])
    line = bent(np.stack([np.linspace(-0.02, 0.02, 30), np.zeros(30), np.zeros(30)], axis=1))
    found = wall_around(turned, line)
    check(found, place[known])
    lengths = np.linalg.norm(np.diff(turned.nodes[found.rings].mean(axis=1), axis=0), axis=1)
    assert 0.0 < lengths.min() <= lengths.max() < 2.5 * 0.04 / (len(found.rings) - 1)
    neighbours = np.abs(np.diff(found.sector_of[place[known]], axis=1))
    assert (np.minimum(neighbours, found.rings.shape[1] - neighbours) <= 1).all()


def test_a_mesh_without_a_hollow_around_the_line_is_refused():
    with pytest.raises(ValueError, match="no inner wall around the line of its lumen"):
        wall_around(mesh(), LINE + np.array([0.0, 0.02, 0.0]))
