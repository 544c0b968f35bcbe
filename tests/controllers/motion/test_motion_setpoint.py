import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.motion.following import Followers
from controllers.motion.setpoint import FOLLOWING_ACCELERATION, Setpoint
from controllers.motion.setpoint_state import Activity
from robots.dvrk import arms

H = 1e-3
CHAIN = arms.chain("PSM1")
START = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.0])
FULL = np.ones(2)


def setpoint(at=START):
    made = Setpoint(CHAIN.joints)
    made.reset(np.array(at))
    return made


def run(made, steps):
    """Return positions and velocities, each shape (steps, n)."""
    rows = []
    for _ in range(steps):
        made.step(H)
        rows.append((made.position.copy(), made.velocity.copy()))
    return np.array(rows).swapaxes(0, 1)


def test_a_move_ends_exactly_at_its_goal_and_keeps_to_the_limits_of_trajectories():
    made, goal = setpoint(), np.array([0.4, -0.3, 0.2, 1.0, -0.5, 0.7])
    made.move(goal, FULL)
    q, v = run(made, 3000)
    assert made.activity is Activity.HOLD
    assert (q[-1] == goal).all()
    assert (v[-1] == 0).all()
    a = np.diff(v, axis=0) / H
    assert (np.abs(v) <= CHAIN.velocity * (1 + 1e-9)).all()
    assert (np.abs(a) <= CHAIN.acceleration * (1 + 1e-6)).all()
    assert (np.abs(np.diff(a, axis=0)) / H <= CHAIN.jerk * (1 + 1e-4)).all()
    # time-optimal: some joint is at its limit
    assert np.isclose(np.abs(a).max(axis=0) / CHAIN.acceleration, 1.0, rtol=0.02).any()


@pytest.mark.parametrize("ratios", [(0.25, 0.25), (0.25, 1.0), (1.0, 0.25)])
def test_ratios_slow_a_move_down(ratios):
    made, slow = setpoint(), setpoint()
    goal = START + np.array([0.8, 0, 0, 0, 0, 0])
    made.move(goal, FULL)
    slow.move(goal, np.array(ratios))
    q, v = run(slow, 6000)
    assert np.abs(v).max() < 0.7 * np.abs(run(made, 6000)[1]).max()
    assert (q[-1] == goal).all()
    assert (np.abs(v) <= ratios[0] * CHAIN.velocity * (1 + 1e-9)).all()
    assert (np.abs(np.diff(v, axis=0)) / H <= ratios[1] * CHAIN.acceleration * (1 + 1e-6)).all()
    assert (np.abs(np.diff(v, 2, axis=0)) / H**2 <= ratios[1] * CHAIN.jerk * (1 + 1e-4)).all()


def test_a_stream_that_states_its_velocity_is_followed_without_lag():
    made, period = setpoint(), 10
    for k in range(0, 2000, period):
        angle = 2 * np.pi * 0.25 * (k + period) * H  # where it is to be when the next goal comes
        goal = START + 0.05 * np.sin(angle) * np.array([1, 1, 0.4, 1, 1, 1])
        velocity = 0.05 * np.pi / 2 * np.cos(angle) * np.array([1, 1, 0.4, 1, 1, 1])
        made.follow(goal, H, velocity)
        _, v = run(made, period)
        if k > 200:
            assert np.abs(made.position - goal).max() < 1e-9
            assert np.abs(np.diff(v, axis=0)).max() < 2e-3  # it does not stutter


def test_a_velocity_is_kept_while_it_is_told_and_then_given_up():
    made, velocity = setpoint(), np.array([0.2, 0, 0.01, 0, 0, -0.3])
    for _ in range(10):
        made.drift(velocity)
        _, v = run(made, 50)
    assert np.allclose(v[-1], velocity, rtol=1e-12)
    run(made, 101)
    _, v = run(made, 200)
    assert made.activity is Activity.HOLD
    assert not v[-1].any()


def test_a_velocity_stops_at_the_end_of_a_range_and_leaves_the_other_joints_alone():
    made, velocity = setpoint(), np.array([0.1, 0, 0.2, 0, 0, 0])
    for _ in range(1000):
        made.drift(velocity)
        made.step(H)
    assert made.position[2] == pytest.approx(CHAIN.upper[2], abs=1e-6)
    assert made.velocity[0] == pytest.approx(0.1)


def test_a_stream_at_the_step_is_followed_without_lag():
    made = setpoint()
    for k in range(3000):
        goal = START + 0.05 * np.sin(2 * np.pi * 0.25 * k * H) * np.array([1, 1, 0.4, 1, 1, 1])
        made.follow(goal, H)
        made.step(H)
        if k > 100:
            assert np.abs(made.position - goal).max() < 1e-12


def test_a_slow_stream_is_followed_smoothly_one_interval_late():
    made, late = setpoint(), []
    for k in range(3000):
        if k % 10 == 0:
            made.follow(START + 0.1 * np.sin(2 * np.pi * 0.25 * k * H) * np.eye(6)[0], H)
        before = made.velocity[0]
        made.step(H)
        late.append(made.position[0] - 0.1 * np.sin(2 * np.pi * 0.25 * (k - 9) * H))
        assert k < 200 or abs(made.velocity[0] - before) < 0.01
    assert np.abs(late[500:]).max() < 1e-5


def test_a_stream_that_ends_ends_at_its_last_goal():
    made = setpoint()
    for k in range(500):
        made.follow(START + 0.2 * k * H * np.eye(6)[0], H)
        made.step(H)
    run(made, 300)
    assert np.allclose(made.position, made.goal, atol=1e-9)
    assert np.abs(made.velocity).max() < 1e-6


@pytest.mark.parametrize("period", [2, 10])
def test_a_stream_that_comes_in_bursts_stays_in_the_range_of_its_goals(period):
    """A busy machine holds messages back for up to 80 ms and delivers them together."""
    made, draw, range_, held_until = setpoint(), np.random.default_rng(5), 0.2, 0
    waiting, positions = [], []
    for k in range(6000):
        if k % period == 0:
            waiting.append(START + range_ * np.sin(np.pi * k * H) * np.eye(6)[0])
        if draw.random() < 0.01:
            held_until = k + draw.integers(20, 80)
        if k >= held_until:
            for goal in waiting:
                made.follow(goal, H)
            waiting = []
        made.step(H)
        positions.append(made.position[0])
    assert np.abs(positions).max() < range_ + 1e-4


def test_a_move_from_full_speed_towards_a_limit_brakes_first():
    made = setpoint()
    made.follow(START + np.array([1.588, 0, 0, 0, 0, 0]), H)
    run(made, 930)
    assert made.velocity[0] > 1.5
    made.move(START, FULL)
    assert made.activity is Activity.BRAKE
    assert made.is_moving
    q, _ = run(made, 5000)
    assert (q[:, 0] <= CHAIN.upper[0]).all()
    assert (q[-1] == START).all()


goals = st.tuples(*[st.floats(0.0, 1.0)] * 6).map(
    lambda share: CHAIN.lower + np.array(share) * (CHAIN.upper - CHAIN.lower)
)
orders = st.lists(
    st.tuples(st.sampled_from(["follow", "move", "slow", "brake", "wait"]), goals, st.integers(1, 150)),
    min_size=1,
    max_size=12,
)


@given(goals, orders)
def test_nothing_ever_jumps(start, orders):
    """Whatever is asked for, at any moment: range, velocity and acceleration are kept, and position is the
    velocity's integral.
    """
    made = setpoint(start)
    for order, goal, steps in orders:
        if order == "follow":
            made.follow(goal, H)
        elif order in ("move", "slow"):
            made.move(goal, FULL if order == "move" else 0.3 * FULL)
        elif order == "brake":
            made.brake()
        q0, v0 = made.position.copy(), made.velocity.copy()
        q, v = run(made, steps)
        q, v = np.vstack([q0, q]), np.vstack([v0, v])
        assert (q >= CHAIN.lower - 1e-12).all()
        assert (q <= CHAIN.upper + 1e-12).all()
        assert (np.abs(v) <= CHAIN.velocity * (1 + 1e-9)).all()
        most = FOLLOWING_ACCELERATION * CHAIN.acceleration * H
        assert (np.abs(np.diff(v, axis=0)) <= most * 1.01).all()
        assert (np.abs(np.diff(q, axis=0)) <= (np.maximum(np.abs(v[1:]), np.abs(v[:-1])) + most) * H).all()


@given(goals, goals, st.integers(1, 400), st.sampled_from(["follow", "move", "brake"]))
def test_a_saved_state_goes_on_with_the_same_bits(goal, other, steps, order):
    made, again = setpoint(), setpoint()
    made.move(goal, FULL)
    run(made, steps)
    {"follow": lambda: made.follow(other, H), "move": lambda: made.move(other, FULL), "brake": made.brake}[
        order
    ]()
    run(made, 20)
    again.state.values[:] = made.state.values
    again.recompute_derived()
    assert (run(made, 300) == run(again, 300)).all()


@pytest.mark.parametrize("activity", ["follow", "move"])
def test_a_goal_where_the_joints_are_moves_nothing(activity):
    made = setpoint()
    made.follow(START, H) if activity == "follow" else made.move(START, FULL)
    q, v = run(made, 5)
    assert np.allclose(q, START, atol=1e-15)
    assert not v.any()


@given(
    st.lists(
        st.tuples(st.integers(0, 2), st.floats(-0.4, 0.4), st.none() | st.floats(-2.0, 2.0)), max_size=12
    )
)
def test_setpoints_that_follow_together_go_where_each_goes_alone(orders):
    jaw = CHAIN.joints[-1:]
    alone, together = [[setpoint(), setpoint(-START), Setpoint(jaw)] for _ in range(2)]
    for made in (*alone, *together):
        made.follow(made.position.copy(), H)
    followers = Followers(together, H)
    for i, goal, velocity in orders:
        for made in (alone[i], together[i]):
            made.follow(made.position + goal, H, None if velocity is None else velocity + 0.0 * made.position)
        for _ in range(3):
            for made in alone:
                made.step(H)
            followers.step()
    assert [one.state.values.tobytes() for one in alone] == [two.state.values.tobytes() for two in together]
