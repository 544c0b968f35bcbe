"""Surfaces found by touching: a tip moves, a force answers."""

from math import atan, exp

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.teleoperation.contact_estimate import ContactEstimate

DT, SCALE = 0.004, 0.2
FREE = np.zeros(3)
numbers = st.floats(-1.0, 1.0)
directions = st.tuples(numbers, numbers, numbers).filter(lambda v: np.linalg.norm(v) > 1e-3).map(lambda v: np.array(v) / np.linalg.norm(v))


def estimate():
    return ContactEstimate(np.zeros(ContactEstimate.SIZE))


def press(surface, stiffness, normal, depths, dt=DT):
    """Follow a tip to `depths` below a plane through the origin that answers with a spring."""
    for depth in depths:
        surface.update(-depth * normal, max(0.0, stiffness * depth) * normal, SCALE, dt)
    return surface


@given(st.floats(50.0, 4000.0), directions)
def test_a_spring_is_found_where_it_is_and_as_stiff_as_it_is(stiffness, normal):
    surface = press(estimate(), stiffness, normal, np.linspace(-0.005, 0.005, 250))
    assert np.allclose(surface.normal, normal, atol=1e-9)
    assert surface.depth == pytest.approx(0.005, abs=0.03 / stiffness + 0.01 / 249 + 1e-6)  # the force is noticed from 0.03 N on
    assert surface.stiffness * surface.depth == pytest.approx(stiffness * 0.005, rel=0.05)
    press(surface, stiffness, normal, np.full(250, 0.005))
    assert surface.stiffness * surface.depth == pytest.approx(stiffness * 0.005, rel=1e-3)


moves = st.lists(st.tuples(st.tuples(numbers, numbers, numbers), st.tuples(numbers, numbers, numbers), st.sampled_from([0.001, 0.004, 0.02])), max_size=40)


@given(moves)
def test_it_claims_no_more_than_was_measured_but_for_what_fades_in_20_ms_and_the_force_lies_in_the_cone(moves):
    surface, tip = estimate(), np.zeros(3)
    for move, force, dt in moves:
        tip, force, before = tip + 0.01 * np.array(move), 3.0 * np.array(force), surface.stiffness
        surface.update(tip, force, SCALE, dt)
        size = np.linalg.norm(force)
        if size < 0.03:
            assert surface.depth <= 0.0
            continue
        push = surface.normal @ force
        assert np.linalg.norm(surface.normal) == pytest.approx(1.0)
        assert np.arccos(min(1.0, push / size)) < atan(0.5) + 1e-7
        assert surface.depth > 0.0
        assert surface.stiffness * surface.depth <= push + max(0.0, before * surface.depth - push) * exp(-dt / 0.02) + 1e-9
        assert 0.0 <= surface.friction <= 0.5 + 1e-9


def test_friction_tilts_no_surface_and_sliding_makes_no_depth():
    surface, up = estimate(), np.array([0.0, 0.0, 1.0])
    press(surface, 500.0, up, np.linspace(0.0, 0.004, 200))
    for y in np.linspace(0.0, 0.02, 200):
        surface.update(np.array([0.0, y, -0.004]), np.array([0.0, -0.6, 2.0]), SCALE, DT)
    assert np.array_equal(surface.normal, up)
    assert surface.depth == pytest.approx(0.004, abs=2e-4)
    assert surface.friction == pytest.approx(0.3, rel=1e-3)


def test_what_gives_way_is_a_surface_at_the_tip_and_what_is_left_is_remembered_nearby():
    surface, up = estimate(), np.array([0.0, 0.0, 1.0])
    press(surface, 500.0, up, np.linspace(0.0, 0.004, 200))
    stiffness = surface.stiffness
    press(surface, 500.0, up, np.linspace(0.004, -0.003, 100))
    assert (surface.known, surface.stiffness) == (True, pytest.approx(stiffness, rel=0.1))
    assert surface.depth == pytest.approx(-0.003, abs=2e-4)
    surface.update(-0.002 * up, FREE, SCALE, DT)
    assert surface.depth == 0.0
    surface.update(0.0105 * up, FREE, SCALE, DT)
    assert not surface.known
    assert surface.stiffness == 0.0


def test_the_first_touch_is_felt_softly():
    """With a hand that comes out of a link late, the tip is deep before anything is known: the force grows over 0.1 s."""
    surface = estimate()
    for i in range(100):
        surface.update(np.array([0.0, 0.0, -0.005]), np.array([0.0, 0.0, 1.0]), SCALE, DT)
        assert surface.stiffness * surface.depth == pytest.approx(1.0 - exp(-(i + 1) * DT / 0.1))
