"""Joints along the paths of a hand, beyond half a turn of the roll."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.cholecystectomy.reach import path_margins
from robots.transform import matrix_to_pose
from tests.controllers.cholecystectomy.world import World

ROLL = 3


@cache
def psm1():
    return World().hands["PSM1"]


def hold(joints):
    """Put the hand at these joints, shape (6,)."""
    hand = psm1()
    hand.joints[:] = joints
    hand.measured[:] = matrix_to_pose(tip(joints))
    hand.stay()


def tip(joints):
    return psm1().base @ psm1().chain.frames(joints)[-1]


def joints_with(roll):
    return np.array([0.2, -0.1, 0.12, roll, 0.3, -0.4])


@given(st.floats(-4.4, 4.4), st.floats(-2.5, 2.5))
def test_the_roll_goes_on_beyond_half_a_turn(roll, turn):
    hold(joints_with(roll))
    path = np.array([joints_with(roll + share * turn) for share in np.linspace(0.0, 1.0, 6)])
    found = psm1().joints_along(np.array([tip(joints) for joints in path]))
    np.testing.assert_allclose(found, path, atol=1e-6)


def test_a_path_that_turns_the_roll_out_of_range_has_no_margin():
    hold(joints_with(4.0))
    ways = np.array([[tip(joints_with(4.0 + turn))] for turn in (-1.0, 0.2, 1.0)])
    margins, joints = path_margins(psm1(), ways)
    assert joints[:, 0, ROLL] == pytest.approx([3.0, 4.2, 5.0])
    assert margins[0] > margins[1] > 0.0 > margins[2]
