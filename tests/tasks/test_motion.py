"""Metrics of paths: against closed forms, and what must not change them."""

from math import pi, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import spherical_jn

from robots import rotation
from tasks.metrics.motion import Economy, Paths, Turning, WorkingVolume
from tasks.metrics.smoothing import kernels
from tasks.metrics.smoothness import FREQUENCIES, Smoothness, spectral_arc_length
from tests.tasks.trials import grasp, measured, minimum_jerk, place

SMALL = st.floats(-1.0, 1.0)
VECTORS = st.tuples(SMALL, SMALL, SMALL).map(np.array)
IDLE = 1e-3


@given(st.lists(SMALL, min_size=4, max_size=4), st.sampled_from([5, 9, 21]), st.floats(1e-3, 0.1))
def test_velocity_and_jerk_of_a_cubic_are_exact(coefficients, count, period):
    a, b, c, d = coefficients
    t = (np.arange(count) - count // 2) * period
    velocity, jerk = kernels(count, period) @ (a + b * t + c * t**2 + d * t**3)
    assert velocity == pytest.approx(b, abs=1e-7 / period)
    assert jerk == pytest.approx(6 * d, abs=1e-7 / period**3)


def test_the_path_of_a_straight_movement_is_its_length():
    found = measured(Paths(["PSM1"], IDLE), minimum_jerk(2.0, 0.1))
    assert found["PSM1/path_length"] == pytest.approx(0.1, rel=1e-4)


def test_a_tip_at_rest_is_idle():
    resting = np.zeros((100, 3))
    assert measured(Paths(["PSM1"], IDLE), resting)["PSM1/idle_share"] == 1.0
    assert measured(Paths(["PSM1"], IDLE), resting)["PSM1/path_length"] == 0.0


def test_a_trial_that_is_too_short_has_no_path_and_no_idle_share():
    found = measured(Paths(["PSM1"], IDLE), np.zeros((3, 3)))
    assert found == {"PSM1/path_length": None, "PSM1/idle_share": None}
    assert measured(Turning(["PSM1"]), np.zeros((0, 3)))["PSM1/angular_path"] is None


def metrics():
    return Paths(["PSM1"], IDLE), Economy(["PSM1"]), WorkingVolume(["PSM1"]), Smoothness(["PSM1"], IDLE)


@given(VECTORS, VECTORS)
def test_a_rigid_transform_of_the_path_changes_none(turn, shift):
    rng = np.random.default_rng(0)
    tips = minimum_jerk(1.0, 0.05) + 1e-3 * np.cumsum(rng.normal(size=(200, 3)), axis=0) / 14
    moved = tips @ rotation.matrix(rotation.exp(turn)).T + shift
    events = [(60, grasp()), (150, place(0, 0, 0))]
    for one, other in zip(metrics(), metrics(), strict=True):
        before, after = measured(one, tips, events=events), measured(other, moved, events=events)
        assert after == pytest.approx(before, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("duration", [2.0, 4.0, 8.0])
def test_normalised_jerk_of_a_minimum_jerk_movement_is_the_root_of_360(duration):
    # the integral of the squared jerk is 720 L^2 / T^5, most of it at both ends, which are smoothed and cut
    found = measured(Smoothness(["PSM1"], IDLE), minimum_jerk(duration, 0.1))
    assert found["PSM1/normalised_jerk"] == pytest.approx(sqrt(360.0), rel=0.16)


@given(st.floats(0.01, 0.2))
def test_normalised_jerk_has_no_scale(length):
    one = measured(Smoothness(["PSM1"], 1e-2 * length), minimum_jerk(2.0, length))
    other = measured(Smoothness(["PSM1"], 1e-2 * 0.1), minimum_jerk(2.0, 0.1))
    assert one["PSM1/normalised_jerk"] == pytest.approx(other["PSM1/normalised_jerk"], rel=1e-6)


@pytest.mark.parametrize("duration", [0.5, 1.0, 2.0, 4.0])
def test_spectral_arc_length_of_a_minimum_jerk_movement_is_that_of_its_closed_form(duration):
    # the speed 30 tau^2 (1 - tau)^2 L / T has the spectrum 15 j_2(k) / k^2 with k = pi f T
    k = pi * FREQUENCIES[1:] * duration
    spectrum = np.concatenate([[1.0], 15.0 * spherical_jn(2, k) / k**2])
    found = measured(Smoothness(["PSM1"], IDLE), minimum_jerk(duration, 0.1))
    assert found["PSM1/spectral_arc_length"] == pytest.approx(spectral_arc_length(spectrum), rel=0.02)


def test_a_movement_in_two_parts_is_less_smooth_than_one():
    whole = minimum_jerk(2.0, 0.1)
    one = minimum_jerk(1.2, 0.05)[:150]
    halves = np.concatenate([one, one + one[-1]])
    smooth, jerky = (measured(Smoothness(["PSM1"], IDLE), tips) for tips in (whole, halves))
    assert jerky["PSM1/spectral_arc_length"] < smooth["PSM1/spectral_arc_length"]
    assert jerky["PSM1/normalised_jerk"] > smooth["PSM1/normalised_jerk"]


def test_a_tip_that_has_not_moved_has_no_smoothness():
    found = measured(Smoothness(["PSM1"], IDLE), np.zeros((100, 3)))
    assert found == {"PSM1/normalised_jerk": None, "PSM1/spectral_arc_length": None}


def test_economy_is_the_straight_way_between_events_over_the_path():
    out = minimum_jerk(1.0, 0.1)
    back = np.concatenate([out, out[::-1]])
    events = [(len(out) - 1, grasp()), (len(back) - 1, place(0, 0, 0))]
    assert measured(Economy(["PSM1"]), back, events=events)["PSM1/economy"] == pytest.approx(1.0, rel=1e-3)
    late = [(len(back) - 1, grasp())]  # where it began
    assert measured(Economy(["PSM1"]), back, events=late)["PSM1/economy"] is None
    assert measured(Economy(["PSM1"]), back)["PSM1/economy"] is None


def test_the_workspace_radius_is_the_spread_about_the_mean():
    angle = np.linspace(0.0, 2.0 * pi, 500, endpoint=False)
    circle = 0.03 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(500)]) + 0.2
    found = measured(WorkingVolume(["PSM1"]), circle)
    assert found["PSM1/workspace_radius"] == pytest.approx(0.03, rel=1e-9)


@given(VECTORS.filter(lambda v: np.linalg.norm(v) > 0.1), VECTORS)
def test_angular_path_of_a_turn_about_an_axis_is_its_angle_in_any_frame(axis, base):
    frame, count = rotation.exp(base), 100
    turns = [rotation.product(frame, rotation.exp(axis * i / count)) for i in range(count + 1)]
    found = measured(Turning(["PSM1"]), np.zeros((count + 1, 3)), turns=turns)
    assert found["PSM1/angular_path"] == pytest.approx(np.linalg.norm(axis), rel=1e-9)
