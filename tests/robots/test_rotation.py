import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from robots import rotation

coordinates = st.floats(-4.0, 4.0, allow_subnormal=False)
vectors = st.tuples(coordinates, coordinates, coordinates).map(np.array)
quaternions = vectors.map(rotation.exp)


@given(vectors)
def test_exp_is_the_rotation_that_scipy_makes(v):
    assert np.allclose(rotation.matrix(rotation.exp(v)), Rotation.from_rotvec(v).as_matrix(), atol=1e-12)


@given(quaternions)
def test_log_and_exp_undo_each_other(q):
    again = rotation.exp(rotation.log(q))
    assert abs(abs(again @ q) - 1.0) < 1e-12
    assert np.linalg.norm(rotation.log(q)) <= np.pi + 1e-12


@given(st.floats(0.0, 1e-5), vectors)
def test_log_keeps_small_rotations_exact(size, direction):
    v = size * direction
    assert np.allclose(rotation.log(rotation.exp(v)), v, rtol=1e-9, atol=1e-20)


@given(quaternions, quaternions)
def test_product_is_that_of_the_matrices(a, b):
    assert np.allclose(
        rotation.matrix(rotation.product(a, b)), rotation.matrix(a) @ rotation.matrix(b), atol=1e-12
    )


@given(quaternions, quaternions)
def test_the_turn_to_a_goal_is_the_log_of_the_difference_to_the_bit(goal, start):
    r = rotation.matrix(start)
    turn = rotation.log(rotation.product(goal, rotation.conjugate(rotation.from_matrix(r))))
    assert np.array(rotation.turn_to(goal, r)).tobytes() == turn.tobytes()


@given(quaternions)
def test_conjugate_is_the_inverse(q):
    assert np.allclose(rotation.product(q, rotation.conjugate(q)), [0, 0, 0, 1], atol=1e-12)


@given(quaternions)
def test_from_matrix_undoes_matrix(q):
    again = rotation.from_matrix(rotation.matrix(q))
    assert abs(np.linalg.norm(again) - 1.0) < 1e-12
    assert abs(abs(again @ q) - 1.0) < 1e-12


def test_from_matrix_holds_at_half_turns():
    for axis in np.eye(3):
        half_turn = rotation.exp(np.pi * axis)
        assert abs(abs(rotation.from_matrix(rotation.matrix(half_turn)) @ half_turn) - 1.0) < 1e-15


def test_the_quaternions_of_many_matrices_are_those_of_each_to_the_bit():
    turns = np.random.default_rng(7).normal(size=(40, 3)) * np.linspace(0.0, 4.0, 40)[:, None]
    matrices = np.array([rotation.matrix(rotation.exp(turn)) for turn in turns])
    each = np.array([rotation.from_matrix(matrix) for matrix in matrices])
    assert rotation.from_matrices(matrices).tobytes() == each.tobytes()
