"""The law on its own: least squares with limits, and goals within and out of reach."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares, minimize

from bench.vision_goals import depths, features, limits, random_goal, servo
from controllers.visual_servoing.camera import project_points, seen_points
from controllers.visual_servoing.law import interaction_matrix, joint_velocities
from controllers.visual_servoing.least_squares import solve_constrained
from robots import rotation
from robots.dvrk.endoscope import BASELINE, left_camera

CHAIN = left_camera("straight", BASELINE)
seeds = st.integers(0, 2**32 - 1).map(np.random.default_rng)


@given(seeds)
def test_constrained_least_squares_is_the_least_there_is(rng):
    a, b = rng.normal(size=(6, 3)), rng.normal(size=6)
    g, h = rng.normal(size=(8, 3)), np.maximum(rng.normal(size=8), 0.0)
    x = solve_constrained(a, b, g, h)
    assert (g @ x <= h + 1e-7).all()
    # nothing that is allowed is nearer: the objective is convex, so a way of descent would be seen nearby
    reference = minimize(
        lambda y: float(((a @ y - b) ** 2).sum()),
        x,
        constraints={"type": "ineq", "fun": lambda y: h - g @ y, "jac": lambda y: -g},
        method="SLSQP",
        options={"ftol": 1e-12},
    )
    assert ((a @ x - b) ** 2).sum() <= reference.fun + 1e-6


@given(seeds)
def test_the_interaction_matrix_is_the_derivative_of_the_projection(rng):
    points = rng.uniform([-0.05, -0.05, 0.1], [0.05, 0.05, 0.3], (4, 3))
    twist, h = rng.normal(size=6), 1e-6

    def after(seconds):
        turn = rotation.matrix(rotation.exp(twist[3:] * seconds))
        return project_points((points - twist[:3] * seconds) @ turn)

    expected = (after(h) - after(-h)) / (2.0 * h)
    found = interaction_matrix(project_points(points), points[:, 2]) @ twist
    assert np.allclose(found, expected.ravel(), rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("law", ["direct", "twist"])
def test_goals_within_reach_are_reached_within_all_limits(law):
    rng = np.random.default_rng(5)
    times = [servo(law, 2.0, *random_goal(rng), seconds=4.0).time for _ in range(8)]
    assert np.median(times) <= 2.3
    assert max(times) < 4.0


def test_out_of_reach_the_direct_law_rests_where_the_error_is_least_and_the_classical_one_does_not():
    rng = np.random.default_rng(8)
    worse = []
    for _ in range(4):
        reached, start, target = random_goal(rng)
        goal = features(CHAIN.forward(reached), target) + rng.normal(size=(4, 2)) * 0.03
        best = least_squares(
            lambda q, target=target, goal=goal: (features(CHAIN.forward(q), target) - goal).ravel(),
            reached,
            bounds=(CHAIN.lower, CHAIN.upper),
            xtol=1e-12,
        )
        least = np.sqrt(2.0 * best.cost)
        direct = servo("direct", 2.0, reached, start, target, goal=goal, seconds=12.0)
        assert direct.rest == pytest.approx(least, rel=0.01)
        worse.append(servo("twist", 2.0, reached, start, target, goal=goal, seconds=12.0).rest / least)
    assert max(worse) > 1.01


@given(seeds)
def test_no_limit_is_passed_wherever_it_is_sent(rng):
    _, q, target = random_goal(rng)
    frames = CHAIN.frames(q)
    seen = features(frames[-1], target)
    goal = seen + rng.normal(size=(4, 2))
    for law in ("direct", "twist"):
        away = depths(frames[-1], target)
        jacobian = CHAIN.jacobian(frames, frame="tip")
        velocities = joint_velocities(law, q, jacobian, seen, goal, away, 5.0, limits(away))
        assert (abs(velocities) <= CHAIN.velocity * (1.0 + 1e-9)).all()
        after = q + 0.04 * velocities
        assert (after >= CHAIN.lower - 1e-9).all()
        assert (after <= CHAIN.upper + 1e-9).all()
        moved = seen_points(CHAIN.forward(after), target, np.zeros((1, 3)))
        assert moved[0, 2] > 0.0
