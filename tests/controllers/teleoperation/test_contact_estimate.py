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
directions = (
    st.tuples(numbers, numbers, numbers)
    .filter(lambda v: np.linalg.norm(v) > 1e-3)
    .map(lambda v: np.array(v) / np.linalg.norm(v))
)


def estimate():
    return ContactEstimate()


def press(surface, stiffness, normal, depths, dt=DT):
    """Follow a tip to `depths` below a plane through the origin that answers with a spring."""
    for depth in depths:
        surface.update(-depth * normal, max(0.0, stiffness * depth) * normal, SCALE, dt)
    return surface


@given(st.floats(50.0, 4000.0), directions)
def test_a_spring_is_found_where_it_is_and_as_stiff_as_it_is(stiffness, normal):
    surface = press(estimate(), stiffness, normal, [*np.linspace(-0.005, 0.005, 250), *np.full(250, 0.005)])
    assert np.allclose(surface.normal, normal, atol=1e-9)
    depth = surface.depth(-0.005 * normal)
    # noticed from 0.05 N on, in means over 20 ms at 10 mm/s
    assert 0.005 - 0.05 / stiffness - 5e-5 < depth < 0.005 + 0.02 * 0.01
    assert surface.stiffness * depth == pytest.approx(stiffness * 0.005, rel=1e-3)


def test_a_tip_that_moves_on_is_deeper_at_once():
    surface, up = estimate(), np.array([0.0, 0.0, 1.0])
    press(surface, 500.0, up, [*np.linspace(0.0, 0.004, 200), *np.full(100, 0.004)])
    before = surface.depth(-0.004 * up)
    press(surface, 500.0, up, [0.005])
    assert surface.depth(-0.005 * up) == pytest.approx(before + 0.001, abs=1e-6)


moves = st.lists(
    st.tuples(
        st.tuples(numbers, numbers, numbers),
        st.tuples(numbers, numbers, numbers),
        st.sampled_from([0.001, 0.004, 0.02]),
    ),
    max_size=40,
)


@given(moves)
def test_it_claims_no_more_than_was_measured_but_for_what_fades_in_20_ms_and_the_force_lies_in_the_cone(
    moves,
):
    """Of force and tip their means over 20 ms count."""
    surface, tip, mean, force = estimate(), np.zeros(3), np.zeros(3), np.zeros(3)
    for i, (move, newest, dt) in enumerate(moves):
        tip, share, before = tip + 0.01 * np.array(move), 1.0 - exp(-dt / 0.02), surface.stiffness
        mean = mean + share * (tip - mean) if i else tip
        force = force + share * (3.0 * np.array(newest) - force)
        surface.update(tip, 3.0 * np.array(newest), SCALE, dt)
        depth, size, push = surface.depth(mean), np.linalg.norm(force), surface.normal @ force
        if size < 0.05 - 1e-9:
            assert depth <= 1e-12
        elif size > 0.05 + 1e-9:
            assert np.linalg.norm(surface.normal) == pytest.approx(1.0)
            assert np.arccos(min(1.0, push / size)) < atan(0.5) + 1e-6
            assert depth > 0.0
            assert (
                surface.stiffness * depth <= push + max(0.0, before * depth - push) * exp(-dt / 0.02) + 1e-9
            )
            assert 0.0 <= surface.friction <= 0.5 + 1e-6


def test_what_shakes_about_zero_is_no_contact():
    """As the coupling to tissue does in free air when the hand moves in steps: 0.1 N each way, for 4 ms."""
    surface = estimate()
    for i in range(500):
        surface.update(np.array([0.0, 0.0, -1e-4 * i]), np.array([0.0, 0.0, 0.1 * (-1) ** i]), SCALE, DT)
        assert not surface.known


def test_friction_tilts_no_surface_and_sliding_makes_no_depth():
    surface, up = estimate(), np.array([0.0, 0.0, 1.0])
    press(surface, 500.0, up, [*np.linspace(0.0, 0.004, 200), *np.full(100, 0.004)])
    for y in np.linspace(0.0, 0.02, 200):
        surface.update(np.array([0.0, y, -0.004]), np.array([0.0, -0.6, 2.0]), SCALE, DT)
    assert np.array_equal(surface.normal, up)
    assert surface.depth(np.array([0.0, 0.02, -0.004])) == pytest.approx(0.004, abs=2e-4)
    assert surface.friction == pytest.approx(0.3, rel=1e-3)


def test_what_gives_way_is_a_surface_at_the_tip_and_what_is_left_is_remembered_nearby():
    surface, up = estimate(), np.array([0.0, 0.0, 1.0])
    press(surface, 500.0, up, np.linspace(0.0, 0.004, 400))
    stiffness = surface.stiffness
    press(surface, 500.0, up, [*np.linspace(0.004, -0.003, 400), *np.full(100, -0.003)])
    assert surface.known
    assert surface.stiffness > stiffness  # as the force ends a little above where it was noticed first
    assert surface.depth(0.003 * up) == pytest.approx(-0.003, abs=2e-4)
    for _ in range(100):
        surface.update(-0.002 * up, FREE, SCALE, DT)
    assert surface.depth(-0.002 * up) == pytest.approx(0.0, abs=1e-9)
    for _ in range(100):
        surface.update(0.0105 * up, FREE, SCALE, DT)
    assert not surface.known
    assert surface.stiffness == 0.0


def test_the_first_touch_is_felt_softly():
    """With a hand that comes out of a link late, the tip is deep before anything is known: the force grows
    over 0.1 s.
    """
    surface, forces = estimate(), []
    for _ in range(100):
        surface.update(np.array([0.0, 0.0, -0.005]), np.array([0.0, 0.0, 1.0]), SCALE, DT)
        forces.append(surface.stiffness * surface.depth(np.array([0.0, 0.0, -0.005])))
    grown = 1.0 - np.exp(-np.arange(1, 101) * DT / 0.1)
    assert np.all(np.diff(forces) > 0.0)
    assert np.all(forces < grown + 1e-9)
    assert forces[-1] == pytest.approx(1.0, abs=0.05)
