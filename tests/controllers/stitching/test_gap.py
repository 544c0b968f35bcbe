"""The distance of two instruments, beside that of many points on them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from controllers.stitching.gap import instrument_gap
from robots import rotation
from robots.transform import pose_to_matrix
from tests.controllers.stitching.test_guided import Guided

HANDS = Guided().lead._hands
POINTS = np.linspace(0.0, 1.0, 200)[:, None]
numbers = st.floats(-0.05, 0.05)
tips = st.tuples(numbers, numbers, numbers, *[st.floats(-2.0, 2.0)] * 3)


def framed_tip(tip):
    return pose_to_matrix(np.concatenate([tip[:3], rotation.exp(np.array(tip[3:]))]))


def points(hand, tip):
    centre, wrist = hand.base[:3, 3], tip[:3, 3]
    end = wrist + hand.jaw.length * tip[:3, 2]
    return np.concatenate([centre + POINTS * (wrist - centre), wrist + POINTS * (end - wrist)])


@given(tips, tips)
def test_the_gap_is_that_of_the_nearest_points(first, second):
    one, other = framed_tip(first), framed_tip(second)
    a, b = points(HANDS[0], one), points(HANDS[1], other)
    sampled = np.sqrt(((a[:, None] - b[None]) ** 2).sum(axis=2)).min()
    found = instrument_gap(HANDS[0], one[None], HANDS[1], other[None])[0]
    assert found <= sampled + 1e-12
    assert found >= sampled - 1.2e-3  # points on a shaft are up to 1.1 mm apart


def test_instruments_that_cross_have_no_gap():
    middle = (HANDS[0].base[:3, 3] + HANDS[1].base[:3, 3]) / 2.0
    beyond = np.eye(4)
    beyond[:3, 3] = middle - HANDS[0].base[:3, 3] + middle  # the other arm's remote centre
    assert instrument_gap(HANDS[0], beyond[None], HANDS[1], framed_tip((0.0,) * 6)[None])[0] < 1e-9
