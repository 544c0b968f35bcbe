"""A simulated hand that touches through delayed links comes to rest and feels what the tip feels; the study
of bench/haptic_stability.py, in short.
"""

from dataclasses import replace

import pytest

from bench import haptic_stability as study


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("case", ["table, 200 N/m", "spring, 300 N/m", "hard, rubbed"])
def test_the_hand_comes_to_rest_at_any_delay(case, delay):
    trial = replace(study.CASES[case], delay=delay, duration=6.5)
    found = study.figures(study.run(trial, trial.builder()))
    assert found["swing_m"] < 1e-3
    assert found["swing_m"] <= found["swing_before_m"] + 1e-5
    if case.startswith("spring"):
        assert found["hand_force_n"] == pytest.approx(found["tip_force_n"], rel=0.02)


def test_the_obvious_estimate_swings_and_the_study_shows_it():
    """A surface that follows from the newest force and the stiffest plane allowed, at 100 ms."""
    assert (
        study.figures(study.run(replace(study.CASES["spring, 300 N/m"], delay=0.1), study.Naive()))["swing_m"]
        > 2e-3
    )


@pytest.mark.parametrize("stiffness", [50.0, 200.0, 400.0])
def test_a_tangent_of_up_to_twice_the_secant_leaves_a_margin(stiffness):
    assert study.largest_gain(stiffness, 0.1) > 1.0
