from __future__ import annotations

from math import inf, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from devices.openhaptics.motion import Tip
from robots import rotation

BASE = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""From HDAPI's axes (x right, y up, z towards the user) to REP 103's (x ahead, y left, z up)."""
OFFSET = 0.039
AWAY = (-0.5, 0.5, -0.5, 0.5)
"""A stylus that points level away from the user: z ahead, x to the right, y down."""

vectors = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array)


def _transform(turn: NDArray[np.float64], position_m: NDArray[np.float64]) -> list[float]:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, 1e3 * position_m
    return matrix.T.ravel().tolist()  # column after column


def _orientation(tip: Tip) -> NDArray[np.float64]:
    return np.array(tip.rotation).reshape(3, 3)


def test_a_stylus_that_points_away_from_the_user() -> None:
    tip = Tip(OFFSET)
    assert tip.move(_transform(np.eye(3), np.array([0.01, 0.02, 0.03])), (1.0, 2.0, 3.0), 0.0)
    assert tip.position == pytest.approx((-0.03 + OFFSET, -0.01, 0.02))
    assert tip.linear == pytest.approx((-0.003, -0.001, 0.002))
    assert abs(rotation.from_matrix(_orientation(tip)) @ AWAY) == pytest.approx(1.0)


@given(turn=vectors, position=vectors)
def test_pose_of_the_tip_in_the_axes_of_rep_103(
    turn: NDArray[np.float64], position: NDArray[np.float64]
) -> None:
    tip, given_turn = Tip(OFFSET), Rotation.from_rotvec(3.0 * turn).as_matrix()
    assert tip.move(_transform(given_turn, position), (0.0, 0.0, 0.0), 0.0)
    expected = BASE @ given_turn @ np.diag([1.0, -1.0, -1.0])
    assert np.allclose(_orientation(tip), expected, atol=1e-12)
    assert np.linalg.det(_orientation(tip)) == pytest.approx(1.0)
    assert np.allclose(tip.position, BASE @ position + OFFSET * expected[:, 2], atol=1e-12)


@given(rate=vectors.filter(lambda v: np.linalg.norm(v) > 0.1), start=vectors, velocity=vectors)
def test_twist_of_a_stylus_that_turns_evenly(
    rate: NDArray[np.float64], start: NDArray[np.float64], velocity: NDArray[np.float64]
) -> None:
    """The angular velocity settles on the true one, and the tip's velocity is what its positions say."""
    tip, dt, steps = Tip(OFFSET), 0.001, 150
    turns = (
        Rotation.from_rotvec(np.outer(np.arange(steps) * dt, rate)) * Rotation.from_rotvec(start)
    ).as_matrix()
    positions, linear = np.zeros((steps, 3)), np.zeros((steps, 3))
    for k, turn in enumerate(turns):
        assert tip.move(_transform(turn, velocity * k * dt), 1e3 * velocity, k * dt)
        positions[k], linear[k] = tip.position, tip.linear
    assert np.allclose(tip.angular, BASE @ rate, atol=1e-5)
    assert np.allclose(linear[-2], (positions[-1] - positions[-3]) / (2 * dt), atol=1e-6)


@given(number=st.sampled_from((nan, inf, -inf)), at=st.sampled_from([0, 4, 8, 12, 13, 14]))
def test_what_is_no_pose_is_refused_and_leaves_the_last_one(number: float, at: int) -> None:
    tip, transform = Tip(OFFSET), _transform(np.eye(3), np.zeros(3))
    assert tip.move(transform, (0.0, 0.0, 0.0), 0.0)
    before = tip.position, tip.rotation, tip.linear, tip.angular
    broken = [number if i == at else value for i, value in enumerate(transform)]
    assert not tip.move(broken, (0.0, 0.0, 0.0), 0.001)
    assert not tip.move(transform, (0.0, number, 0.0), 0.002)
    assert not tip.move([0.0] * 16, (0.0, 0.0, 0.0), 0.003)  # what a device has before its first frame
    assert (tip.position, tip.rotation, tip.linear, tip.angular) == before
