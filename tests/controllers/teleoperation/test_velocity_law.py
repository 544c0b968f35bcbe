import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from controllers.teleoperation.params import TeleoperationParams
from controllers.teleoperation.velocity_law import advance
from robots import rotation
from tests.controllers.teleoperation.rig import H, Session

CHAIN = TeleoperationParams(instrument="400006").chain
STEP = H * 1e-9
WEIGHTS = np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.1])
configurations = st.tuples(
    *(st.floats(low, high) for low, high in zip(0.95 * CHAIN.lower, 0.95 * CHAIN.upper, strict=True))
).map(lambda values: np.round(values, 9))  # a parameter of 1e-45 rad is refused
vectors = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array)


def twist_between(before, after, step):
    """The tip's mean twist in its own frame, from two poses alone."""
    moved = np.linalg.inv(before) @ after
    return np.concatenate([moved[:3, 3], rotation.log(rotation.from_matrix(moved))]) / step


def least_singular_value(q):
    return np.linalg.svd(WEIGHTS[:, None] * CHAIN.jacobian(CHAIN.frames(q), frame="tip"), compute_uv=False)[
        -1
    ]


@given(configurations, vectors, vectors, vectors)
def test_the_hands_twist_in_its_own_frame_is_the_tips_in_its_own(q, linear, angular, turned):
    """The paper's law, in any configuration that is not singular: what is commanded moves the tip as the hand
    moves, by kinematics alone.
    """
    assume(least_singular_value(q) > 0.004)
    session = Session(law="velocity", instrument="400006", scale=0.2, start=q.tolist())
    session.hand[3:] = rotation.exp(turned)
    to_hand = rotation.matrix(session.hand[3:]).T
    session.twist[:] = np.concatenate([0.005 * linear, 0.02 * angular])
    expected = np.concatenate([0.2 * to_hand @ session.twist[:3], to_hand @ session.twist[3:]])
    exact = np.linalg.solve(CHAIN.jacobian(CHAIN.frames(q), frame="tip"), expected)
    after = q + STEP * exact
    assume(
        (np.abs(exact) < CHAIN.velocity).all()
        and (after >= CHAIN.lower).all()
        and (after <= CHAIN.upper).all()
    )
    session.step()
    assert np.allclose((session.command - q) / STEP, exact, rtol=1e-9, atol=1e-9)
    short = 1e-4 * STEP
    found = twist_between(CHAIN.forward(q), CHAIN.forward(q + (session.command - q) * 1e-4), short)
    assert np.allclose(found, expected, atol=1e-5)


@given(configurations, vectors, vectors)
def test_near_a_singularity_the_damped_joints_stay_slow_and_err_by_little(q, linear, angular):
    """With the largest damping l and the smallest singular value below it, a joint moves at most by |v| / (2
    l), and the tip is no faster than it is told.
    """
    q[2] = 0.0156 + 1e-3 * q[2]  # the wrist pitch axis passes the remote centre
    assume(least_singular_value(q) < 0.002)
    twist = np.concatenate([1e-4 * linear, 1e-3 * angular])
    moved = advance(CHAIN, q, twist, STEP) - q
    assert np.linalg.norm(moved) / STEP <= np.linalg.norm(WEIGHTS * twist) / (2.0 * 0.003) + 1e-12
    found = CHAIN.jacobian(CHAIN.frames(q), frame="tip") @ moved / STEP
    assert np.linalg.norm(WEIGHTS * found) <= np.linalg.norm(WEIGHTS * twist) * (1.0 + 1e-9)


@pytest.mark.parametrize("axis", range(6))
def test_what_a_limit_cuts_is_not_made_up_for(axis):
    """Into a limit and back: the arm leaves it in the first step in which the hand turns round."""
    session = Session(law="velocity", instrument="400006", scale=1.0, start=[1.3, 0.8, 0.22, 4.0, 1.0, 1.0])
    session.twist[axis] = 0.3 if axis < 3 else 2.0
    session.hand[3:] = rotation.from_matrix(CHAIN.forward(np.array(session.params.start)))
    blocked = 0
    while blocked < 100:
        before = session.command
        session.step()
        session.hand[3:] = session.outputs["goal_cp"][3:]
        assert (session.command >= CHAIN.lower).all()
        assert (session.command <= CHAIN.upper).all()
        assert (np.abs(session.command - before) <= CHAIN.velocity * STEP * (1 + 1e-9)).all()
        blocked += bool(((session.command <= CHAIN.lower) | (session.command >= CHAIN.upper)).any())
    session.twist[:] *= -0.01
    before, start = session.command, CHAIN.forward(session.command)
    session.step()
    wanted = np.concatenate(
        [
            rotation.matrix(session.hand[3:]).T @ session.twist[:3],
            rotation.matrix(session.hand[3:]).T @ session.twist[3:],
        ]
    )
    if least_singular_value(before) > 0.004:
        assert twist_between(start, CHAIN.forward(session.command), STEP) @ wanted > 0.5 * wanted @ wanted


def test_nothing_moves_while_the_clutch_is_pressed_or_the_twist_is_stale():
    session = Session(law="velocity", instrument="400006")
    session.twist[:] = 0.01
    session.step(count=5)
    held = session.command
    session.step([1], count=5)
    assert (session.command == held).all()
    session.step([0])
    assert (session.command != held).any()
    session.driver.stale("master_twist")
    held = session.command
    session.driver.step()
    assert (session.command == held).all()
