"""Layouts of actions: goals come back through rows, and rows without a meaning are refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from robots import rotation
from robots.policies.actions import ACTIONS
from schemas.errors import MotionError

TIP_LAYOUTS = [name for name, layout in ACTIONS.items() if layout.space == "tip"]
numbers = st.floats(-1.0, 1.0)


@st.composite
def poses(draw):
    vector = draw(arrays(np.float64, 3, elements=st.floats(-3.0, 3.0)))
    return np.concatenate([draw(arrays(np.float64, 3, elements=numbers)), rotation.exp(vector)])


@st.composite
def goals(draw):
    return np.array([[*draw(poses()), draw(numbers)] for _ in range(draw(st.integers(1, 5)))])


def apart(one, other):
    """Largest distance of positions and jaws, and largest angle, of goals."""
    turns = [
        rotation.log(rotation.product(a[3:7], rotation.conjugate(b[3:7])))
        for a, b in zip(one, other, strict=True)
    ]
    return np.abs(one[:, [0, 1, 2, 7]] - other[:, [0, 1, 2, 7]]).max(), np.linalg.norm(turns, axis=1).max()


@pytest.mark.parametrize("name", TIP_LAYOUTS)
@given(goals(), poses())
def test_goals_come_back_through_rows(name, wanted, tip):
    layout = ACTIONS[name]
    rows = layout.encode(wanted, tip)
    assert rows.shape == (len(wanted), sum(len(g.fields) for g in layout.groups("PSM1", "ECM", ())))
    length, angle = apart(layout.decode(rows, tip), wanted)
    assert length < 1e-9
    assert angle < 1e-6


@given(arrays(np.float64, (3, 7), elements=numbers))
def test_joint_goals_are_rows(rows):
    layout = ACTIONS["joint"]
    assert np.array_equal(layout.decode(rows, np.zeros(7)), rows)
    assert np.array_equal(layout.encode(rows, np.zeros(7)), rows)


def test_a_relative_row_of_nothing_is_the_observed_tip():
    tip = np.array([0.1, -0.2, 0.3, *rotation.exp(np.array([0.3, -1.0, 0.2]))])
    (goal,) = ACTIONS["rel-xyz-rot6d"].decode(np.array([[0, 0, 0, 1.0, 0, 0, 0, 1.0, 0, 0.5]]), tip)
    assert apart(goal[None], np.array([[*tip, 0.5]])) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_a_relative_displacement_is_along_the_axes_of_the_observed_tip():
    tip = np.array([0.1, 0.0, 0.0, *rotation.exp(np.array([0.0, 0.0, np.pi / 2]))])
    (goal,) = ACTIONS["rel-xyz-rot6d"].decode(np.array([[0.01, 0, 0, 1.0, 0, 0, 0, 1.0, 0, 0.0]]), tip)
    assert goal[:3] == pytest.approx([0.1, 0.01, 0.0])


@pytest.mark.parametrize(
    ("name", "row", "part"),
    [
        ("open-h-dvrk", np.zeros(8), "quaternion"),
        ("rel-xyz-rot6d", np.zeros(10), "first column"),
        ("rel-xyz-rot6d", np.array([0, 0, 0, 1.0, 0, 0, 1.0, 0, 0, 0]), "second column"),
    ],
)
def test_a_rotation_that_is_none_is_named(name, row, part):
    with pytest.raises(MotionError, match=f"row 0: the {part}"):
        ACTIONS[name].decode(row[None], np.array([0, 0, 0, 0, 0, 0, 1.0]))
