"""Algebra of rigid transforms and cross products."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from robots import rotation
from robots.transform import inverse_transform, matrix_to_pose, pose_to_matrix, rigid_transform, translation
from robots.vector3 import cross
from schemas.vectors import Vector

vectors = arrays(float, 3, elements=st.floats(-10.0, 10.0))
matrices = arrays(float, (4, 3), elements=st.floats(-10.0, 10.0))


@st.composite
def poses(draw: st.DrawFn) -> Vector:
    turn = rotation.exp(draw(arrays(float, 3, elements=st.floats(-3.0, 3.0))))
    return np.concatenate([draw(vectors), turn])


@given(poses())
def test_a_pose_survives_the_round_trip_up_to_the_sign_of_its_quaternion(pose: Vector) -> None:
    back = matrix_to_pose(pose_to_matrix(pose))
    assert back[:3] == pytest.approx(pose[:3])
    assert abs(back[3:] @ pose[3:]) == pytest.approx(1.0)


@given(poses())
def test_the_inverse_undoes_a_transform_on_either_side(pose: Vector) -> None:
    matrix = pose_to_matrix(pose)
    inverse = inverse_transform(matrix)
    assert matrix @ inverse == pytest.approx(np.eye(4), abs=1e-12)
    assert inverse @ matrix == pytest.approx(np.eye(4), abs=1e-12)
    assert inverse_transform(inverse) == pytest.approx(matrix)


@given(poses(), poses())
def test_the_inverse_of_a_composition_is_the_composition_of_the_inverses(a: Vector, b: Vector) -> None:
    one, other = pose_to_matrix(a), pose_to_matrix(b)
    assert inverse_transform(one @ other) == pytest.approx(
        inverse_transform(other) @ inverse_transform(one), abs=1e-11
    )
    composed = matrix_to_pose(one @ other)
    turn = rotation.product(a[3:], b[3:])
    assert composed[:3] == pytest.approx(one[:3, :3] @ b[:3] + a[:3], abs=1e-11)
    assert abs(composed[3:] @ turn) == pytest.approx(1.0)


@given(poses(), vectors)
def test_a_transform_is_a_rotation_then_a_translation(pose: Vector, point: Vector) -> None:
    turn = rigid_transform(rotation.matrix(pose[3:]), (0.0, 0.0, 0.0))
    moved = translation(*pose[:3].tolist()) @ turn
    assert moved == pytest.approx(pose_to_matrix(pose))
    assert (moved @ [*point, 1.0])[:3] == pytest.approx(moved[:3, :3] @ point + pose[:3], abs=1e-11)


@given(st.lists(poses(), min_size=1, max_size=3))
def test_many_transforms_are_inverted_as_one_is(several: list[Vector]) -> None:
    stacked = np.stack([pose_to_matrix(pose) for pose in several])
    for inverse, matrix in zip(inverse_transform(stacked), stacked, strict=True):
        assert inverse == pytest.approx(inverse_transform(matrix), abs=1e-14)


@given(matrices, matrices)
def test_a_cross_product_has_the_bits_of_numpys_alone_and_among_others(a: Vector, b: Vector) -> None:
    products = cross(a, b)
    assert np.array_equal(products, np.cross(a, b))
    assert np.array_equal(products[1], cross(a[1], b[1]))
    assert products.flags.c_contiguous
    assert cross(np.asfortranarray(a), b).flags.c_contiguous


@given(vectors, vectors)
def test_a_cross_product_is_normal_to_both_and_changes_sign_with_their_order(a: Vector, b: Vector) -> None:
    product = cross(a, b)
    assert [product @ a, product @ b] == pytest.approx([0.0, 0.0], abs=1e-10)
    assert product == pytest.approx(-cross(b, a))
