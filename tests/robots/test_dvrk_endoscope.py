from __future__ import annotations

from math import pi, radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.dvrk import ecm, setup_joints
from robots.dvrk.endoscope import BASELINE, StereoCamera, optical_in_roll
from robots.dvrk.inverse import inverse
from schemas.vectors import Vector

CAMERA = StereoCamera()


def camera_in_cart(endoscope: ecm.Endoscope) -> Vector:
    """The optical frame of a whole cart at rest, with the arm homed: the roll link's frame is the tip's of a
    straight endoscope.
    """
    base = setup_joints.base_pose("ECM", np.array(setup_joints.SIMULATED["ECM"]))
    return base @ ecm.chain("straight").forward(np.array(ecm.HOME)) @ optical_in_roll(endoscope)


def test_the_field_of_view_spans_the_width() -> None:
    half = np.tan(CAMERA.field_of_view / 2)
    edges = CAMERA.intrinsics() @ np.array([[-half, half], [0.0, 0.0], [1.0, 1.0]])
    assert edges[0] == pytest.approx([-0.5, CAMERA.width - 0.5])  # the outer edges of the outer pixels


@given(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(0.01, 2.0))
def test_a_point_lies_farther_left_in_the_right_picture(x: float, y: float, z: float) -> None:
    left, right = (CAMERA.projection(eye) @ [x, y, z, 1.0] / z for eye in ("left", "right"))
    assert left[1] == right[1]
    assert left[0] - right[0] == pytest.approx(CAMERA.focal_length * BASELINE / z)


def test_the_picture_is_upright_and_shows_each_arm_on_the_side_of_the_hand_that_moves_it() -> None:
    camera = camera_in_cart("straight")
    right, down, ahead = camera[:3, 0], camera[:3, 1], camera[:3, 2]
    assert ahead[2] < -0.5  # it looks down into the patient
    assert abs(right[2]) < 0.1
    assert down[2] < 0.0
    arms = {
        arm: setup_joints.base_pose(arm, np.array(setup_joints.SIMULATED[arm]))[:3, 3] - camera[:3, 3]
        for arm in ("PSM1", "PSM2")
    }
    assert arms["PSM1"] @ right > 0.0 > arms["PSM2"] @ right  # the surgeon's right hand moves PSM1


@pytest.mark.parametrize(("endoscope", "angle"), [("straight", 0.0), ("up", 30.0), ("down", -30.0)])
def test_an_endoscope_looks_up_or_down_in_its_own_picture(endoscope: ecm.Endoscope, angle: float) -> None:
    straight, turned = camera_in_cart("straight"), camera_in_cart(endoscope)
    ahead = straight[:3, :3].T @ turned[:3, 2]
    assert np.arctan2(-ahead[1], ahead[2]) == pytest.approx(radians(angle))
    assert turned[:3, 0] == pytest.approx(straight[:3, 0])
    assert turned[:3, 3] == pytest.approx(straight[:3, 3])


def test_the_view_of_a_straight_endoscope_is_a_quarter_turn_from_the_roll_link() -> None:
    assert optical_in_roll("straight")[:2, :2] == pytest.approx(
        np.array([[0.0, -1.0], [1.0, 0.0]]), abs=pi * 1e-16
    )


@pytest.mark.parametrize("endoscope", ["straight", "up", "down"])
def test_in_the_frame_of_the_view_x_is_left_and_y_up_in_the_picture_and_poses_come_back(
    endoscope: ecm.Endoscope,
) -> None:
    chain, q = ecm.chain(endoscope, "view"), np.array([0.2, -0.1, 0.12, 0.3])
    pose = chain.forward(q)
    picture = ecm.chain("straight").forward(q) @ optical_in_roll(endoscope)
    assert pose[:3, :3] == pytest.approx(picture[:3, :3] * [-1.0, -1.0, 1.0])
    assert pose[:3, 3] == pytest.approx(picture[:3, 3])
    assert inverse(chain, pose, q) == pytest.approx(q)
