import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robots import rotation
from robots.dvrk import psm
from robots.dvrk.instruments import instrument
from robots.inverse_kinematics import approach

CHAIN = psm.chain(instrument("palpation-probe"))
MIDDLE = np.array(psm.HOME)
ANY_STEP = np.full(6, np.inf)
near = st.tuples(*(st.floats(-s, s) for s in (0.3, 0.3, 0.05, 0.5, 0.5, 0.5))).map(lambda d: MIDDLE + np.array(d))


def goal_of(q):
    tip = CHAIN.forward(q)
    return tip[:3, 3], rotation.from_matrix(tip)


@given(near)
def test_a_reachable_goal_is_reached(q):
    position, orientation = goal_of(q)
    found = MIDDLE
    for _ in range(15):
        found = approach(CHAIN, found, position, orientation, ANY_STEP)
    assert np.allclose(CHAIN.forward(found), CHAIN.forward(q), atol=1e-9)


@given(near, st.tuples(*[st.floats(-1, 1)] * 6).map(np.array))
def test_one_correction_follows_a_small_motion_to_second_order(q, direction):
    moved = q + 1e-4 * direction * [1, 1, 0.1, 1, 1, 1]
    position, orientation = goal_of(moved)
    found = approach(CHAIN, q, position, orientation, ANY_STEP)
    assert np.linalg.norm(CHAIN.forward(found)[:3, 3] - position) < 1e-7


@settings(max_examples=50)
@given(near, st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_limits_hold_for_any_goal(q, x, y, z):
    step = 1e-3 * CHAIN.velocity
    for _ in range(50):
        after = approach(CHAIN, q, np.array([x, y, z]), np.array([1.0, 0.0, 0.0, 0.0]), step)
        assert (np.abs(after - q) <= step * (1 + 1e-12)).all()
        assert (after >= CHAIN.lower).all()
        assert (after <= CHAIN.upper).all()
        q = after


def test_at_the_goal_nothing_moves():
    position, orientation = goal_of(MIDDLE)
    assert np.allclose(approach(CHAIN, MIDDLE, position, orientation, ANY_STEP), MIDDLE, atol=1e-15)
