import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hub.planning.coupling import bond_plans, is_fresh, linearised_gain, stable_step_problem
from schemas.ports import BondSide
from schemas.scenario import Bond

ALGORITHMS = ["impulse", "impulse-linearised", "gauss-seidel", "jacobi"]
positive = st.floats(1e-4, 1e4)


def bond(algorithm, **rest):
    return Bond.model_validate({"motion": "robot.tip", "force": "tissue.tip", "algorithm": algorithm, **rest})


def sides(mass=None, stiffness=None, damping=None, contact=None, proxy=0.02):
    motion = BondSide(name="tip", side="motion", effective_mass=mass)
    return motion, BondSide(
        name="tip",
        side="force",
        stiffness=stiffness,
        damping=damping,
        proxy_mass=proxy,
        contact_stiffness=contact,
    )


@pytest.mark.parametrize(
    ("algorithm", "rest", "motion", "force"),
    [
        ("impulse", {}, False, True),
        ("impulse-linearised", {}, False, True),
        ("jacobi", {}, False, False),
        ("gauss-seidel", {"order": ["robot", "tissue"]}, True, False),
        ("gauss-seidel", {"order": ["tissue", "robot"]}, False, True),
    ],
)
def test_which_side_sees_the_other_within_the_step(algorithm, rest, motion, force):
    assert (is_fresh(bond(algorithm, **rest), "motion"), is_fresh(bond(algorithm, **rest), "force")) == (
        motion,
        force,
    )


def test_what_the_sides_are_told():
    _, force = sides(stiffness=500.0, damping=6.0)
    for plan in bond_plans(bond("impulse", prediction="slope"), force, 1e-3):
        assert (plan.prediction, plan.mean, plan.correction) == ("slope", True, None)
    for plan in bond_plans(bond("jacobi"), force, 1e-3):
        assert (plan.prediction, plan.mean, plan.correction) == ("hold", False, None)
    motion, other = bond_plans(bond("impulse-linearised"), force, 1e-3)
    assert other.correction is None
    assert (motion.correction.stiffness, motion.correction.damping) == (500.0, 6.0)
    assert motion.correction.gain == linearised_gain(1e-3, 500.0, 6.0, 0.02)


@given(positive, positive, positive, positive)
def test_the_gain_is_the_reflected_mass_over_what_the_coupling_does_in_a_step(step, stiffness, damping, mass):
    reflected = mass * -math.expm1(-step * math.sqrt(stiffness / mass))
    assert linearised_gain(step, stiffness, damping, mass) == pytest.approx(
        reflected / (stiffness * step**2 / 6 + damping * step / 2), rel=1e-6
    )


@given(positive, positive, positive)
def test_the_gain_in_the_limits_of_short_and_long_steps(stiffness, damping, mass):
    short = 1e-5 * min(damping / stiffness, math.sqrt(mass / stiffness))
    assert linearised_gain(short, stiffness, damping, mass) == pytest.approx(
        2 * math.sqrt(stiffness * mass) / damping, rel=1e-4
    )
    long = 1e5 * max(damping / stiffness, math.sqrt(mass / stiffness))
    assert linearised_gain(long, stiffness, damping, mass) == pytest.approx(
        6 * mass / (stiffness * long**2), rel=1e-4
    )


def test_a_critically_damped_proxy_is_taken_over_wholly_in_short_steps():
    assert linearised_gain(1e-7, 500.0, 2 * math.sqrt(500.0 * 0.02), 0.02) == pytest.approx(1.0, rel=1e-3)


@given(positive, positive, positive, st.floats(0.01, 1.0))
def test_a_proxy_of_long_sub_steps_is_heavier_at_once(step, stiffness, mass, share):
    proxy_step, damping = share * step, 2 * math.sqrt(stiffness * mass)
    gains = [
        linearised_gain(step, stiffness, damping, mass, sub_step)
        for sub_step in (0.0, 1e-6 * proxy_step, proxy_step)
    ]
    assert gains[1] == pytest.approx(gains[0], rel=1e-3)
    assert gains[0] <= gains[2] * (1 + 1e-9)
    assert gains[2] * (stiffness * step**2 / 6 + damping * step / 2) <= mass * (1 + 1e-9)


def limit(algorithm, mass, stiffness, damping, contact):
    if algorithm == "impulse-linearised":
        return min(0.5 * math.sqrt(mass * (1 / stiffness + 1 / contact)), 0.25 * math.sqrt(mass / contact))
    return min(
        0.5 * mass / damping,
        0.25 * math.sqrt(mass / contact) if algorithm == "impulse" else 0.5 * math.sqrt(mass / stiffness),
    )


@given(st.sampled_from(ALGORITHMS), positive, positive, positive, positive, st.floats(0.01, 100.0))
def test_a_step_is_refused_just_beyond_its_limit(algorithm, mass, stiffness, damping, contact, share):
    allowed = limit(algorithm, mass, stiffness, damping, contact)
    problem = stable_step_problem(
        bond(algorithm, order=["tissue", "robot"]),
        *sides(mass, stiffness, damping, contact, proxy=None),
        share * allowed,
    )
    if share <= 0.999:
        assert problem is None
    if share >= 1.001:
        assert problem is not None
        assert f"which allows {allowed * 1e3:.4g} ms" in problem


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_number_that_is_not_stated_is_not_checked(algorithm):
    assert stable_step_problem(bond(algorithm), *sides(stiffness=1e9, damping=1e9), 1.0) is None
    assert stable_step_problem(bond(algorithm), *sides(mass=1e-9, proxy=None), 1.0) is None


def test_the_problem_names_rule_and_numbers():
    problem = stable_step_problem(bond("impulse"), *sides(mass=0.01, stiffness=500.0, damping=10.0), 1e-3)
    assert (
        "a step of 1 ms breaks the rule H <= 0.5 m/b of 'impulse', which allows 0.5 ms (m = 0.01, k = 500, b"
        " = 10, m_proxy = 0.02 in SI units)" in problem
    )


def test_a_tool_much_lighter_than_the_proxy_is_refused():
    assert (
        stable_step_problem(bond("impulse-linearised"), *sides(mass=0.01, stiffness=500.0, damping=6.0), 1e-3)
        is None
    )
    problem = stable_step_problem(
        bond("impulse-linearised"), *sides(mass=0.009, stiffness=500.0, damping=6.0), 1e-3
    )
    assert problem is not None
    assert (
        "the rule m >= 0.5 m_proxy of 'impulse-linearised' is broken (m = 0.009, k = 500, b = 6, m_proxy ="
        " 0.02 in SI units)" in problem
    )
