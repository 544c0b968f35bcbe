"""Distances from triangles: against points spread over them, and from what nodes alone do not show."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from controllers.cholecystectomy.obstacles import Obstacles
from controllers.cholecystectomy.surfaces import Surfaces
from schemas.errors import StateError
from schemas.ros import Header
from schemas.trocar_msgs import SoftBodyState

GRID = 1e-3 * np.arange(-20.0, 21.0)
coordinates = st.integers(-10, 10).map(lambda number: 1e-3 * number)
SHARES = np.array([(a, b, 40 - a - b) for a in range(41) for b in range(41 - a)]) / 40.0


@given(arrays(float, (3, 3, 3), elements=coordinates), arrays(float, (2, 3), elements=coordinates))
def test_the_distance_is_that_of_the_nearest_point_of_all_triangles(corners, points):
    found = Obstacles(corners, np.zeros(3)).distances(points, 1.0)
    spread = (SHARES @ corners).reshape(-1, 3)
    sampled = np.linalg.norm(points[:, None] - spread, axis=2).min(axis=1)
    longest = max(np.linalg.norm(np.roll(corners, 1, axis=1) - corners, axis=2).max(), 1e-3)
    assert (found <= sampled + 1e-9).all()
    assert (found >= sampled - longest / 20.0).all()


def test_a_blade_between_the_nodes_of_a_face_is_seen():
    nodes = np.array([[0.0, 0.0, 0.0], [6.0, 0.0, 0.0], [0.0, 6.0, 0.0]]) * 1e-3
    tip = np.array([[2e-3, 2e-3, 0.4e-3]])
    assert Obstacles(nodes[None], np.zeros(1)).distances(tip, 5e-3)[0] == pytest.approx(0.4e-3)
    assert Obstacles.points(nodes, np.zeros(3)).distances(tip, 5e-3)[0] > 2.8e-3


def test_thickness_counts_and_far_obstacles_do_not():
    line = Obstacles.line(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]), np.full(2, 2e-3))
    points = np.array([[0.05, 3e-3, 0.0], [0.05, 1e-3, 0.0], [0.05, 0.3, 0.0]])
    cut = Obstacles.line(np.eye(3), np.zeros(3), np.array([True, False]))
    assert cut.corners.shape == (1, 3, 3)
    assert line.distances(points, 4e-3) == pytest.approx([1e-3, -1e-3, 4e-3])
    assert len(Obstacles.join([line]).near(np.array([0.5, 0.0, 0.0]), 0.1).radii) == 0


def first(triangles, nodes=4):
    """Return the first state of a body."""
    return SoftBodyState(
        header=Header(),
        body="liver",
        nodes_m=np.zeros(3 * nodes, np.float32),
        triangles=np.array(triangles, np.uint32).ravel(),
    )


def test_triangles_are_kept_saved_and_restored():
    surfaces, other = Surfaces(["liver", "duct"]), Surfaces(["liver", "duct"])
    nodes = np.eye(4, 3)
    assert len(surfaces.obstacles("liver", nodes).radii) == 4  # nodes, for want of faces
    surfaces.see("liver", first([[0, 1, 2], [1, 2, 3]]))
    surfaces.see("liver", first([]))
    assert surfaces.obstacles("liver", nodes).corners.shape == (2, 3, 3)
    assert surfaces.digest != other.digest
    other.restore(surfaces.save())
    assert surfaces.digest == other.digest
    assert (other.obstacles("liver", nodes).corners == surfaces.obstacles("liver", nodes).corners).all()


@pytest.mark.parametrize("cut", [slice(0, 3), slice(0, -1), slice(0, -4), slice(2, None)])
def test_a_damaged_state_is_refused(cut):
    surfaces = Surfaces(["liver", "duct"])
    surfaces.see("liver", first([[0, 1, 2], [1, 2, 3]]))
    with pytest.raises(StateError, match="a saved state of clip-and-cut"):
        surfaces.restore(surfaces.save()[cut])
