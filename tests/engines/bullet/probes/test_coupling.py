"""The energy book of a press and release: what the coupling makes, at every step that its rules let pass."""

import pytest

from schemas.errors import ScenarioError
from tests.engines.bullet.press_and_release import cycle


@pytest.mark.parametrize(
    ("mass", "algorithm", "step_ms"),
    [
        (0.4, "impulse", 1),
        (0.4, "impulse", 5),
        (0.02, "impulse-linearised", 1),
        (0.1, "impulse-linearised", 2),
    ],
)
def test_next_to_no_energy_is_made(mass, algorithm, step_ms):
    made, exchanged = cycle(mass, step_ms, algorithm)
    assert exchanged > 1e-3
    assert made < 0.01 * exchanged


@pytest.mark.parametrize(
    ("mass", "algorithm", "step_ms"), [(0.4, "impulse", 1), (0.05, "impulse-linearised", 1)]
)
def test_nor_by_the_spring_in_series(mass, algorithm, step_ms):
    made, exchanged = cycle(mass, step_ms, algorithm, sub_grid=True)
    assert exchanged > 3e-4
    assert made < 0.01 * exchanged


@pytest.mark.parametrize(
    ("mass", "algorithm", "step_ms", "rule"),
    [
        (0.02, "impulse", 1, "H <= 0.5 m/b of 'impulse'"),
        (0.1, "impulse-linearised", 5, r"H <= 0.25 sqrt\(m/k_contact\) of 'impulse-linearised'"),
        (0.01, "impulse-linearised", 1, "m >= 0.5 m_proxy of 'impulse-linearised'"),
    ],
)
def test_where_it_would_be_more_the_step_is_refused(mass, algorithm, step_ms, rule):
    with pytest.raises(ScenarioError, match=rule):
        cycle(mass, step_ms, algorithm)
