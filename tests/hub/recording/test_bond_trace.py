"""Force against depth: the same curve, however often the bond was sampled."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hub.recording.bond_trace import BondTrace

TIMES_S = np.arange(4000) * 1e-3


def press(normal, tilt=0.0):
    """Return a press of 5 mm with 100 N/m at 5 mm/s, then 20 mm along the surface with friction, and back."""
    side = np.cross(normal, [1.0, 0.0, 0.0] if abs(normal[0]) < 0.7 else [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    height = np.interp(TIMES_S, [0.2, 1.8, 3.0, 4.0], [3e-3, -5e-3, -5e-3, 3e-3])
    along = np.interp(TIMES_S, [1.8, 3.0], [0.0, 20e-3])
    force = 100.0 * np.maximum(0.0, -height)
    moves = (TIMES_S > 1.8) & (TIMES_S < 3.0)
    position = height[:, None] * normal + along[:, None] * side
    return position, force[:, None] * (normal - tilt * moves[:, None] * side)


def trace(position, force, every=1):
    return BondTrace("x", TIMES_S[::every], position[::every], force[::every])


@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 4, 16, 64]))
def test_depth_is_that_along_the_normal_however_often_it_was_sampled(seed, every):
    numbers = np.random.default_rng(seed)
    normal = numbers.normal(size=3)
    normal /= np.linalg.norm(normal)
    position, force = press(normal, tilt=0.3)
    (contact,) = trace(position + numbers.normal(size=3), force, every).contacts
    shallow = 0.05 * np.linalg.norm(force, axis=1).max() / 100.0  # a contact begins at 5 % of the peak
    assert contact.depth.max() == pytest.approx(5e-3 - shallow, abs=2e-5)
    assert contact.force.max() == pytest.approx(0.5 * np.hypot(1.0, 0.3), rel=2e-3)


def test_the_mean_direction_would_take_friction_for_depth():
    """What the normal spares: 20 mm along the surface, with a force that is tilted by friction."""
    position, force = press(np.array([0.0, 0.0, 1.0]), tilt=0.3)
    (contact,) = trace(position, force).contacts
    mean = force.mean(axis=0)
    assert (-position @ (mean / np.linalg.norm(mean))).max() > contact.depth.max() + 1e-3


def test_contacts_are_told_apart():
    push = np.where((TIMES_S > 0.1) & (TIMES_S < 0.3) | (TIMES_S > 0.5) & (TIMES_S < 0.7), 1.0, 0.0)
    push[200:210] = 0.0  # too short an interruption
    push[1000] = 1.0  # a single sample: no line
    spans = [(one.times_s[0], one.times_s[-1]) for one in trace(np.zeros((4000, 1)), push[:, None]).contacts]
    assert np.allclose(spans, [(0.101, 0.299), (0.501, 0.699)])


def test_a_contact_without_a_known_beginning_is_left_out():
    position, force = press(np.array([0.0, 0.0, 1.0]))
    force[1300] = np.nan
    (contact,) = trace(position, force).contacts
    assert contact.times_s[-1] == pytest.approx(1.299)


def test_a_thinned_contact_keeps_its_peaks():
    position, force = press(np.array([0.0, 0.0, 1.0]))
    force[2222] *= 1.5
    (contact,) = trace(position, force).contacts
    thin = contact.thin(50)
    assert len(thin.force) <= 52
    assert (thin.depth.max(), thin.force.max()) == (contact.depth.max(), contact.force.max())


def test_no_contact_at_all():
    assert BondTrace("x", np.arange(10.0), np.ones((10, 3)), np.zeros((10, 3))).contacts == []
    assert BondTrace.of_series("x", *2 * (np.empty(0), np.empty((0, 3)))).contacts == []
