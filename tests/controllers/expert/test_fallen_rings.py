"""Ways to take hold of a ring that lies on its side or leans, by plain geometry."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.expert.fallen_rings import Around, grasps_of_fallen_ring
from controllers.expert.plans import upright
from robots.dvrk.instruments import WRIST_RADIUS
from robots.training.boards import BOARDS
from tests.controllers.expert.test_grasps import turned

DRIVER = 10.2e-3
RING = BOARDS["icra2026"].ring


def lying(turn, tip=np.pi / 2):
    """A ring whose axis is tipped (rad) from the vertical, and turned about it; a wall is below."""
    return turned(turn) @ turned(tip, axis=0, position=(0, 0, 0))


def around(pose, posts=()):
    lowest = pose[2, 3] - RING.inradius - RING.thickness
    return Around(lowest, np.array(posts).reshape(-1, 2), 1.8e-3, lowest + 20e-3)


@given(st.floats(-np.pi, np.pi))
def test_a_ring_on_its_side_is_taken_by_a_wall_through_an_open_end(turn):
    pose = lying(turn)
    found = grasps_of_fallen_ring(RING, pose, DRIVER, around(pose))
    assert len(found.poses)
    for tip, up in zip(found.poses, found.ups, strict=True):
        fingers, opening = tip[:3, 2], tip[:3, 1]
        assert np.linalg.det(tip[:3, :3]) == pytest.approx(1.0)
        assert fingers[2] < 0
        assert abs(opening @ up) == pytest.approx(0.0, abs=1e-9)  # the wall lies between the fingers
        ends = pose[:3, :3].T @ (tip[:3, 3] + DRIVER * fingers - pose[:3, 3])
        assert np.hypot(*ends[:2]) >= RING.inradius
        assert abs(ends[2]) == pytest.approx(RING.height / 2 - 4e-3)
        assert tip[2, 3] - WRIST_RADIUS > pose[2, 3] - RING.inradius - RING.thickness


@given(st.floats(-np.pi, np.pi), st.floats(0.4, 1.5))
def test_put_upright_its_taken_end_is_up(turn, tip):
    for up in grasps_of_fallen_ring(RING, lying(turn, tip), DRIVER, around(lying(turn, tip))).ups:
        assert upright(up) @ up == pytest.approx([0, 0, 1], abs=1e-9)


def test_fingers_and_wrist_keep_clear_of_a_post_before_an_end():
    pose = lying(0.0)
    free = grasps_of_fallen_ring(RING, pose, DRIVER, around(pose))
    post = pose[:2, 3] + 14e-3 * pose[:2, 2]
    beside = grasps_of_fallen_ring(RING, pose, DRIVER, around(pose, [post]))
    assert 0 < len(beside.poses) < len(free.poses)
    for tip in beside.poses:
        assert np.linalg.norm(tip[:2, 3] - post) > 1.8e-3 + WRIST_RADIUS


def test_a_ring_between_walls_at_both_ends_cannot_be_taken():
    pose = lying(0.0)
    off = [(RING.height / 2 + 1e-3) * side * pose[:3, 2] + pose[:3, 3] for side in (1, -1)]
    half = np.array([0.05, 1e-3, 0.05])
    walls = tuple((middle - half, middle + half) for middle in off)
    assert not len(grasps_of_fallen_ring(RING, pose, DRIVER, around(pose)._replace(boxes=walls)).poses)
