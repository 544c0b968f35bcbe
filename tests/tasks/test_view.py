"""What the endoscope sees is what is in its pictures."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from robots.dvrk.endoscope import StereoCamera
from tasks.view import Frustum

CAMERA = StereoCamera()
FRUSTUM = Frustum(CAMERA, 0.01, 2.0)


@given(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(0.02, 0.3))
def test_a_point_is_seen_if_it_is_in_one_of_the_two_pictures(x, y, z):
    in_left = np.array([x + 0.5 * CAMERA.baseline, y, z, 1.0])
    inside, margin = False, np.inf
    for eye in ("left", "right"):
        u, v, w = CAMERA.projection(eye) @ in_left
        edges = [u / w + 0.5, CAMERA.width - 0.5 - u / w, v / w + 0.5, CAMERA.height - 0.5 - v / w]
        inside, margin = inside or min(edges) > 0.0, min(margin, abs(min(edges)))
    if margin > 1e-6:  # not on an edge
        assert FRUSTUM.sees(np.eye(4), np.array([[x, y, z]]))[0] == inside


def test_nothing_is_seen_behind_too_near_or_too_far():
    points = np.array([[0.0, 0.0, z] for z in (-0.1, 0.005, 0.1, 1.9, 2.1)])
    assert FRUSTUM.sees(np.eye(4), points).tolist() == [False, False, True, True, False]
