"""Discs in pictures that are drawn with the camera model: found to a fraction of a pixel, and told apart."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.visual_servoing.blobs import find_blobs
from controllers.visual_servoing.target import recognise_target
from robots import rotation
from robots.training.targets import DISC_RADIUS
from tests.controllers.visual_servoing.discs import CAMERA, POINTS, features, picture

F = CAMERA.focal_length
K = CAMERA.intrinsics()


def ahead(depth=0.15, turn=(0.0, 0.0, 0.0), aside=(0.0, 0.0)):
    pose = np.eye(4)
    pose[:3, :3] = rotation.matrix(rotation.exp(np.array(turn)))
    pose[:3, 3] = *aside, depth
    return pose


def nearest(found, expected):
    """Distances (px) of each expected point from the nearest that was found."""
    return np.linalg.norm(found[None] - expected[:, None], axis=2).min(axis=1)


@given(
    st.floats(0.13, 0.25),
    st.tuples(*[st.floats(-0.3, 0.3)] * 2, st.floats(-1.4, 1.4)),
    st.tuples(st.floats(-0.008, 0.008), st.floats(-0.008, 0.008)),
)
def test_discs_are_found_and_recognised_whichever_way_the_camera_is_rolled(depth, turn, aside):
    target = ahead(depth, turn, aside)
    expected = features(np.eye(4), target)
    blobs = find_blobs(cv2, picture(cv2, np.eye(4), target))
    if len(blobs) < 4:  # at the edge of the picture
        assert (abs(expected * F).max(axis=0) > (130, 94)).any()
        return
    before = expected + 0.03
    sight = recognise_target(cv2, blobs, K, POINTS, DISC_RADIUS, before)
    assert sight is not None
    assert abs(sight.features - expected).max() * F < 0.25  # centroids are up to 1 px off
    assert np.allclose(sight.pose[:3, 3], target[:3, 3], atol=4e-3)


def test_a_disc_that_is_seen_straight_on_is_found_to_a_tenth_of_a_pixel():
    for aside in np.random.default_rng(1).uniform(-1e-3, 1e-3, (10, 2)):
        target = ahead(aside=aside)
        found = find_blobs(cv2, picture(cv2, np.eye(4), target))
        assert nearest(found, features(np.eye(4), target) * F + K[:2, 2]).max() < 0.12


def test_what_is_no_whole_disc_on_red_is_not_taken():
    target = ahead()
    image = picture(cv2, np.eye(4), target)
    cv2.circle(image, (20, 20), 9, (255, 255, 255), -1)  # white on black
    cv2.rectangle(image, (170, 135), (190, 150), (255, 255, 255), -1)  # white on red, but no disc
    centre = np.round(features(np.eye(4), target)[0] * F + K[:2, 2]).astype(int)
    cv2.circle(image, centre, 6, (130, 130, 140), -1)  # something grey before a disc
    assert len(find_blobs(cv2, image)) == 3
    assert find_blobs(cv2, np.zeros_like(image)).shape == (0, 2)


def test_a_fifth_disc_is_left_out():
    """A white lid on the box, as round as a disc: those four are taken that are the right rectangle."""
    target = ahead(0.2)
    image = picture(cv2, np.eye(4), target)
    cv2.circle(image, (180, 143), 10, (250, 250, 250), -1, cv2.LINE_AA)
    blobs = find_blobs(cv2, image)
    assert len(blobs) == 5
    expected = features(np.eye(4), target)
    sight = recognise_target(cv2, blobs, K, POINTS, DISC_RADIUS, expected)
    assert sight is not None
    assert abs(sight.features - expected).max() * F < 0.3


@pytest.mark.parametrize("count", range(4))
def test_fewer_than_four_are_no_target(count):
    assert (
        recognise_target(
            cv2, np.random.default_rng(0).uniform(50, 200, (count, 2)), K, POINTS, DISC_RADIUS, POINTS[:, :2]
        )
        is None
    )
