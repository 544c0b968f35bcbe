"""Designed motions stay within the limits, are at rest at both ends, and tell more than random ones."""

import numpy as np
import pytest

from robots.dvrk.instruments import instrument
from robots.identification import excitation as design
from robots.identification.arms import of_ecm, of_psm
from robots.identification.excitation import PERIOD, excitation

ARMS = {"psm": of_psm(instrument("400006"), jaw=True), "ecm": of_ecm()}


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(design, "_TRIES", 3)
    monkeypatch.setattr(design, "_ITERATIONS", 0)


@pytest.mark.long
@pytest.mark.parametrize("arm", ARMS)
def test_a_motion_is_within_the_limits_and_rests_at_home(arm):
    joints, motion = ARMS[arm].joints, excitation(ARMS[arm], 2, 50.0)
    assert motion.time[-1] == pytest.approx(2.0 * PERIOD)
    for i, joint in enumerate(joints):
        assert joint.lower < motion.q[:, i].min()
        assert motion.q[:, i].max() < joint.upper
        assert np.abs(motion.dq[:, i]).max() < joint.velocity
        assert np.abs(motion.ddq[:, i]).max() < joint.acceleration
    for instant in (0, round(50.0 * PERIOD), -1):
        assert motion.q[instant] == pytest.approx(ARMS[arm].start, abs=1e-9)
        assert motion.dq[instant] == pytest.approx(0.0, abs=1e-9)
        assert motion.ddq[instant] == pytest.approx(0.0, abs=1e-9)
    assert np.gradient(motion.q, 0.02, axis=0)[5:-5] == pytest.approx(motion.dq[5:-5], abs=0.02)


def test_the_same_seed_gives_the_same_motion_and_another_another_one():
    first, again, other = (excitation(ARMS["ecm"], 1, 20.0, seed).q for seed in (1, 1, 2))
    assert (first == again).all()
    assert (first != other).any()


def test_the_search_lowers_the_condition_number(monkeypatch):
    before = excitation(ARMS["ecm"], 1, 20.0).condition
    monkeypatch.setattr(design, "_ITERATIONS", 2)
    assert excitation(ARMS["ecm"], 1, 20.0).condition < 0.9 * before
