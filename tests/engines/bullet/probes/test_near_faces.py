"""Which faces spheres are near to, and the points that are nearest."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from engines.tissue.probes.near_faces import closest_points, near_faces
from tests.engines.bullet.rig import SMALL_BLOCK, params

TRIANGLES = arrays(float, (5, 3, 3), elements=st.floats(-1, 1))


@given(arrays(float, 3, elements=st.floats(-2, 2)), TRIANGLES)
def test_no_point_of_a_triangle_is_nearer_than_the_closest(point, corners):
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    corners = corners[area > 1e-3]
    if len(corners):
        weights, distance = closest_points(point, corners)
        assert weights == pytest.approx(np.clip(weights, 0, 1), abs=1e-9)
        np.testing.assert_allclose(weights.sum(axis=1), 1)
        grid = [(a, b, 1 - a - b) for a in np.linspace(0, 1, 9) for b in np.linspace(0, 1 - a, 9)]
        others = np.linalg.norm(np.einsum("gi,fij->gfj", grid, corners) - point, axis=2)
        assert (distance <= others.min(axis=0) + 1e-9).all()


def test_faces_are_near_up_to_the_reach():
    nodes, faces = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]]), np.array([[0, 1, 2]])
    centres = nodes.mean(axis=0) + np.array([[0, 0, 6e-3], [0, 0, 4e-3], [1, 1, 0], [0, 0, -4e-3]])
    spheres, found, weights, distance = near_faces(centres, np.full(4, 5e-3), nodes, faces)
    np.testing.assert_array_equal(spheres, [1, 3])
    np.testing.assert_array_equal(found, [[0, 1, 2]] * 2)
    np.testing.assert_allclose(weights, np.full((2, 3), 1 / 3))
    np.testing.assert_allclose(distance, [4e-3, 4e-3])


@given(st.integers(0, 2**32 - 1))
def test_many_spheres_are_near_to_what_each_is_alone(seed):
    organ = params(SMALL_BLOCK).organs["block"].rest
    random = np.random.default_rng(seed)
    centres = random.uniform(organ.nodes.min(axis=0) - 0.01, organ.nodes.max(axis=0) + 0.01, (6, 3))
    reach = random.uniform(1e-3, 1e-2, 6)
    together = near_faces(centres, reach, organ.nodes, organ.triangles)
    for i in range(6):
        _, distance = closest_points(centres[i], organ.nodes[organ.triangles])
        np.testing.assert_array_equal(together[1][together[0] == i], organ.triangles[distance < reach[i]])
        np.testing.assert_array_equal(together[3][together[0] == i], distance[distance < reach[i]])


@given(st.integers(0, 2**32 - 1))
def test_a_narrower_reach_leaves_what_would_have_been_found_with_it(seed):
    organ = params(SMALL_BLOCK).organs["block"].rest
    random = np.random.default_rng(seed)
    centres = random.uniform(organ.nodes.min(axis=0), organ.nodes.max(axis=0), (4, 3))
    narrow = random.uniform(1e-3, 6e-3, 4)
    wide = near_faces(centres, narrow + 4e-3, organ.nodes, organ.triangles)
    for left, found in zip(
        wide.within(narrow), near_faces(centres, narrow, organ.nodes, organ.triangles), strict=True
    ):
        np.testing.assert_array_equal(left, found)
