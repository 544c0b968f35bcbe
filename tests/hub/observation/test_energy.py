"""Energy books: what the two sides of a bond count is what physics says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hub.observation.energy import EnergyBooks
from hub.participant import BondPlan, ForceSide, Inputs, MotionSide
from hub.planning.plan import Plan, PlannedBond
from schemas.codec import decode
from schemas.lockstep import Ack
from schemas.ports import BondSide
from schemas.scenario import Bond
from schemas.trocar_msgs import CouplingEnergy
from tests.strategies import vectors

K = 80.0
MOTION, FORCE = (
    BondSide(name="tip", side="motion", dof=3),
    BondSide(name="tip", side="force", dof=3, stiffness=K),
)
HELD_VELOCITY, HELD = BondPlan("velocity", mean=True), BondPlan("hold", mean=False)
moves = st.lists(
    st.tuples(st.floats(1e-4, 0.1), vectors(3).map(np.tanh), vectors(3).map(np.tanh)), min_size=1, max_size=8
)
"""Steps of h seconds with a position and a velocity at their start."""


def spring_step(side, h, x, v, substeps=3):
    """Let a spring to the origin follow the motion; return the reaction, which the midpoints give exactly."""
    side.begin(Inputs({"tip/position": x, "tip/velocity": v}), h)
    dt = h / substeps
    for i in range(substeps):
        tau = (i + 0.5) * dt
        side.add(K * side.position(tau), np.zeros_like(x), tau, dt)
    return side.result(K * side.position(h), np.zeros_like(x))


@given(moves)
def test_the_work_of_a_pure_spring_is_its_elastic_energy_however_the_motion_jumps(steps):
    side = ForceSide(FORCE, HELD_VELOCITY)
    outputs = {}
    for h, x, v in steps:
        outputs = spring_step(side, h, x, v)
    h, x, v = steps[-1]
    stored, start = 0.5 * K * np.sum((x + v * h) ** 2), 0.5 * K * np.sum(steps[0][1] ** 2)
    assert outputs["tip/work"][0] == pytest.approx(stored - start, abs=1e-9)


@given(moves)
def test_the_reaction_is_minus_the_mean_force(steps):
    side = ForceSide(FORCE, HELD_VELOCITY)
    for h, x, v in steps:
        np.testing.assert_allclose(spring_step(side, h, x, v)["tip/force"], -K * (x + 0.5 * h * v), atol=1e-9)


@given(moves)
def test_with_held_inputs_the_spring_is_moved_between_the_steps_only(steps):
    side = ForceSide(FORCE, HELD)
    outputs = {}
    for h, x, v in steps:
        outputs = spring_step(side, h, x, v)
        np.testing.assert_allclose(outputs["tip/force"], -K * x, atol=1e-9)
    ends = [0.5 * K * np.sum(steps[i][1] ** 2) for i in (0, -1)]
    assert outputs["tip/work"][0] == pytest.approx(ends[1] - ends[0], abs=1e-9)


@given(moves, vectors(6).map(np.tanh))
def test_a_bond_of_two_points_is_two_bonds_of_one(steps, apart):
    together = ForceSide(FORCE.model_copy(update={"points": 2}), HELD_VELOCITY)
    alone = [ForceSide(FORCE, HELD_VELOCITY) for _ in range(2)]
    for h, x, v in steps:
        positions, velocities = np.tile(x, 2) + apart, np.tile(v, 2) - apart
        both = spring_step(together, h, positions, velocities)
        each = [
            spring_step(side, h, positions[i : i + 3], velocities[i : i + 3])
            for i, side in zip((0, 3), alone, strict=True)
        ]
        np.testing.assert_allclose(
            both["tip/force"], np.concatenate([result["tip/force"] for result in each]), atol=1e-9
        )
        assert both["tip/work"][0] == pytest.approx(sum(result["tip/work"][0] for result in each), abs=1e-9)


@given(st.floats(1e-3, 0.02), st.integers(1, 200), st.floats(0.1, 10.0))
def test_the_residual_of_an_oscillator_is_the_energy_that_the_coupling_made(h, count, mass):
    """A mass on a spring, each side exact in itself: all that is gained or lost comes from their coupling."""
    spring, side = ForceSide(FORCE, HELD_VELOCITY), MotionSide(MOTION, HELD_VELOCITY)
    x, v, predicted = np.array([0.1, 0.0, -0.05]), np.array([0.0, 0.3, 0.1]), np.zeros(3)
    before = 0.5 * K * x @ x + 0.5 * mass * v @ v
    received = given_ = 0.0
    for _ in range(count):
        reaction = spring_step(spring, h, x, v)
        predicted, received = x + h * v, reaction["tip/work"][0]
        side.begin(Inputs({"tip/force": reaction["tip/force"]}), x, v)
        force = side.force(0.0, x, v)
        moved = v * h + 0.5 * force / mass * h**2
        side.add(force, moved)
        x, v = x + moved, v + force / mass * h
        given_ = side.result(x, v)["tip/work"][0]
    after = 0.5 * K * predicted @ predicted + 0.5 * mass * v @ v
    assert received - given_ == pytest.approx(after - before, abs=1e-9 * count)


@pytest.mark.parametrize("side", [ForceSide(FORCE, HELD_VELOCITY), MotionSide(MOTION, HELD_VELOCITY)])
def test_the_state_of_a_side_comes_back(side):
    if isinstance(side, ForceSide):
        spring_step(side, 0.01, np.ones(3), np.ones(3))
    else:
        side.add(np.ones(3), np.ones(3))
    saved, other = (
        side.state.copy(),
        type(side)(FORCE if isinstance(side, ForceSide) else MOTION, HELD_VELOCITY),
    )
    other.state = saved
    np.testing.assert_array_equal(other.state, saved)
    if isinstance(side, ForceSide):
        for one in (side, other):
            spring_step(one, 0.01, np.full(3, 2.0), np.ones(3))
        np.testing.assert_array_equal(side.state, other.state)


def test_the_books_take_the_columns_of_each_participant_in_declared_order():
    first = Bond.model_validate({"motion": "robot.left", "force": "tissue.left"})
    second = Bond.model_validate({"motion": "robot.right", "force": "other.right"})
    sides = BondSide(name="tip", side="motion"), BondSide(name="tip", side="force")
    plan = Plan.model_construct(
        bonds=tuple(PlannedBond(bond=bond, motion=sides[0], force=sides[1]) for bond in (first, second))
    )
    books = EnergyBooks(plan)
    # two steps, two bonds: the last step counts
    books.book_work("robot", Ack(0, 0, 0, [1, 2], [1, 2], [9.0, 9.0, 1.0, 2.0]))
    books.book_work("tissue", Ack(0, 0, 0, [1], [1], [1.5]))
    books.book_work("other", Ack(0, 0, 0, [1], [1], [1.75]))
    books.book_work("camera", Ack(0, 0, 0, [1], [1], []))
    assert books.residual_j == pytest.approx(0.5 - 0.25)
    left, right = (decode(CouplingEnergy, book) for book in books.encode_books(7_000_000_009).values())
    assert list(books.encode_books(0)) == [left.bond, right.bond]
    assert (left.bond, left.motion_work_j, left.force_work_j, left.residual_j, left.header.stamp.ns) == (
        "robot/left",
        1.0,
        1.5,
        0.5,
        7_000_000_009,
    )
    assert (right.bond, right.residual_j) == ("robot/right", -0.25)
