import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares

from robots import rotation
from robots.dvrk import psm
from robots.dvrk.instruments import instrument
from robots.inverse_kinematics import LastFrames, pursue

CHAIN = psm.chain(instrument("palpation-probe"))
MIDDLE = np.array(psm.HOME)
ANY_STEP = np.full(6, np.inf)
near = st.tuples(*(st.floats(-s, s) for s in (0.3, 0.3, 0.05, 0.5, 0.5, 0.5))).map(
    lambda d: MIDDLE + np.array(d)
)


def goal_of(q):
    tip = CHAIN.forward(q)
    return tip[:3, 3], rotation.from_matrix(tip)


@given(near)
def test_a_reachable_goal_is_reached(q):
    position, orientation = goal_of(q)
    found = MIDDLE
    for _ in range(5):
        found = pursue(CHAIN, found, position, orientation, ANY_STEP)
    assert np.allclose(CHAIN.forward(found), CHAIN.forward(q), atol=1e-9)


@given(near, st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_limits_hold_for_any_goal(q, x, y, z):
    step = 1e-3 * CHAIN.velocity
    for _ in range(50):
        after = pursue(CHAIN, q, np.array([x, y, z]), np.array([1.0, 0.0, 0.0, 0.0]), step)
        assert (np.abs(after - q) <= step * (1 + 1e-12)).all()
        assert (after >= CHAIN.lower).all()
        assert (after <= CHAIN.upper).all()
        q = after


@given(st.lists(near, min_size=2, max_size=5))
def test_frames_that_are_kept_change_no_bit(goals):
    frames = LastFrames(CHAIN)
    found = MIDDLE
    for q in goals:
        assert frames(found).tobytes() == CHAIN.frames(found).tobytes()
        plain = pursue(CHAIN, found, *goal_of(q), 1e-2 * CHAIN.velocity)
        kept = pursue(CHAIN, found, *goal_of(q), 1e-2 * CHAIN.velocity, frames)
        assert kept.tobytes() == plain.tobytes()
        found = kept


def test_at_the_goal_nothing_moves():
    position, orientation = goal_of(MIDDLE)
    assert (pursue(CHAIN, MIDDLE, position, orientation, ANY_STEP) == MIDDLE).all()


def weighted_error(q, position, orientation):
    tip = CHAIN.forward(q)
    turn = rotation.log(rotation.product(orientation, rotation.conjugate(rotation.from_matrix(tip))))
    return np.concatenate([position - tip[:3, 3], 0.1 * turn])


@pytest.mark.parametrize("seed", range(8))
def test_a_goal_out_of_reach_is_followed_as_closely_as_the_ranges_allow(seed):
    """Pursued along the way out, the command ends where the error is least among all positions inside the
    ranges.
    """
    random = np.random.default_rng(seed)
    q = random.uniform(0.7 * CHAIN.lower, 0.7 * CHAIN.upper)
    q[2] = random.uniform(0.12, 0.22)  # away from the remote centre, where it takes long
    tip, way, turn = CHAIN.forward(q), random.normal(0.0, 0.06, 3), random.normal(0.0, 0.3, 3)
    for share in np.minimum(np.arange(600) / 400, 1.0):
        position = tip[:3, 3] + share * way
        orientation = rotation.product(rotation.exp(share * turn), rotation.from_matrix(tip))
        q = pursue(CHAIN, q, position, orientation, CHAIN.velocity * 4e-3)
    assert (q >= CHAIN.lower).all()
    assert (q <= CHAIN.upper).all()
    least = least_squares(
        weighted_error,
        np.clip(q, CHAIN.lower + 1e-9, CHAIN.upper - 1e-9),
        bounds=(CHAIN.lower, CHAIN.upper),
        args=(position, orientation),
    )
    assert np.linalg.norm(weighted_error(q, position, orientation)) <= np.linalg.norm(least.fun) + 1e-5


def test_pursuing_meets_a_moving_goal_at_every_step():
    q, tip = MIDDLE, CHAIN.forward(MIDDLE)
    for i in range(200):
        position = tip[:3, 3] + 2e-5 * i * np.array([0.6, -0.64, 0.48])
        orientation = rotation.product(
            rotation.exp(1e-3 * i * np.array([0.0, 0.6, 0.8])), rotation.from_matrix(tip)
        )
        q = pursue(CHAIN, q, position, orientation, CHAIN.velocity * 1e-3)
        assert np.linalg.norm(weighted_error(q, position, orientation)) < 1e-14


def test_pursuing_is_never_faster_than_told():
    far, step = CHAIN.forward(MIDDLE)[:3, 3] + [0.03, 0.02, 0.01], CHAIN.velocity * 1e-3
    move = pursue(CHAIN, MIDDLE, far, rotation.from_matrix(CHAIN.forward(MIDDLE)), step) - MIDDLE
    assert np.abs(move / step).max() == pytest.approx(1.0)
