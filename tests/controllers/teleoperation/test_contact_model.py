"""Planes of the hand from planes of the arm."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from controllers.teleoperation.contact_model import (
    ContactModelBuilder,
    ForceParams,
    PlaneParams,
    PlanesParams,
)
from robots import rotation

NONE, STRAIGHT = np.zeros(6), np.eye(3)
numbers = st.floats(-1.0, 1.0)
points = st.tuples(numbers, numbers, numbers).map(lambda v: 0.1 * np.array(v))
vectors = st.tuples(numbers, numbers, numbers).filter(lambda v: np.linalg.norm(v) > 1e-3)
rotations = vectors.map(lambda v: rotation.matrix(rotation.exp(3.0 * np.array(v))))
TABLE = PlaneParams(normal=(0, 0, 1), distance="-136 mm", stiffness="200 N/m", damping=5.0, friction=0.3)


def planes(
    builder,
    hand=NONE[:3],
    tip=NONE[:3],
    to_base=STRAIGHT,
    scale=0.2,
    *,
    following=True,
    tissue=NONE,
    rigid=NONE,
):
    return builder.planes(
        hand, tip, to_base, scale, following=following, tip_wrench=tissue, rigid_wrench=rigid, elapsed=0.004
    )


def push(plane, hand):
    """Return the force of a smooth plane on a hand at rest, as ContactPlane says."""
    normal = np.array([plane.normal.x, plane.normal.y, plane.normal.z])
    return normal * max(0.0, plane.stiffness * (plane.distance - normal @ hand))


@given(
    points,
    points,
    points,
    rotations,
    st.floats(0.05, 1.0),
    st.floats(0.1, 2.0),
    vectors,
    st.floats(-0.2, 0.2).map(lambda distance: round(distance, 6)),  # 1e-127 m is refused
)
def test_the_hand_feels_what_the_tip_would(hand, tip, other, to_base, scale, gain, normal, distance):
    surface = PlaneParams(normal=normal, distance=distance, stiffness=200.0)
    [plane] = planes(
        ContactModelBuilder(ForceParams(scale=gain, max_stiffness=1e6), [surface]), hand, tip, to_base, scale
    )
    there = tip + scale * to_base @ (other - hand)
    at_tip = 200.0 * max(0.0, distance - np.array(surface.normal) @ there) * np.array(surface.normal)
    assert np.allclose(push(plane, other), gain * to_base.T @ at_tip, atol=1e-9)


@given(points, points, rotations, st.floats(0.05, 1.0), points)
def test_a_surface_that_stands_still_stands_still_for_a_hand_that_moves_on(hand, tip, to_base, scale, way):
    builder = ContactModelBuilder(ForceParams(), [TABLE])
    [first], [second] = (
        planes(builder, hand, tip, to_base, scale),
        planes(builder, hand + way, tip + scale * to_base @ way, to_base, scale),
    )
    assert second.distance == pytest.approx(first.distance, abs=1e-12)
    assert second.model_copy(update={"distance": first.distance}) == first


def test_coefficients_are_the_hands():
    [plane] = planes(ContactModelBuilder(ForceParams(scale=0.5), [TABLE]), scale=0.4)
    assert (plane.stiffness, plane.damping, plane.friction) == (
        pytest.approx(200 * 0.5 * 0.4),
        pytest.approx(5.0 * 0.5 * 0.4),
        0.3,
    )
    stiff = TABLE.model_copy(update={"stiffness": 1e5})
    [plane] = planes(ContactModelBuilder(ForceParams(max_stiffness=300.0), [stiff]))
    assert plane.stiffness == 300.0


def test_tissue_and_rigid_things_each_have_a_plane_of_their_own():
    builder = ContactModelBuilder(ForceParams(), [TABLE, TABLE])
    for depth in np.linspace(0.0, 0.004, 300):
        found = planes(
            builder,
            tip=np.array([0.0, 0.0, -depth]),
            tissue=np.array([0, 0, 500.0 * depth, 0, 0, 0]),
            rigid=np.array([-0.5, 0, 0, 0, 0, 0]),
        )
    assert len(found) == 4
    tissue, rigid = found[2:]
    assert (tissue.normal.z, rigid.normal.x) == (1.0, -1.0)
    assert tissue.damping == rigid.damping == ForceParams().damping
    assert np.allclose(push(tissue, np.zeros(3)), [0, 0, 0.2 * 500.0 * 0.004 / 0.2], rtol=0.05)
    # 0.5 N at a hand 0.5 mm deep, which 400 N/m allow 0.2 N
    assert np.allclose(push(rigid, np.zeros(3)), [-0.2, 0, 0], rtol=0.05)


def test_nothing_is_felt_while_the_arm_does_not_follow_but_what_is_touched_is_remembered():
    builder, wrench = ContactModelBuilder(ForceParams(), [TABLE]), np.array([0, 0, 1.0, 0, 0, 0])
    for _ in range(100):
        assert planes(builder, following=False, tissue=wrench) == []
    assert len(planes(builder, tissue=wrench)) == 2
    assert planes(ContactModelBuilder(ForceParams(scale=0.0), [TABLE]), tissue=wrench) == []


def test_its_state_is_all_it_knows():
    one, other, wrench = (
        ContactModelBuilder(ForceParams(), []),
        ContactModelBuilder(ForceParams(), []),
        np.array([0, 0.2, 1.0, 0, 0, 0]),
    )
    for i in range(20):
        planes(one, tip=np.array([0.0, 0.0, -1e-4 * i]), tissue=wrench)
    for mine, others in zip(other.state, one.state, strict=True):
        mine.values[:] = others.values
    assert planes(one, tissue=wrench) == planes(other, tissue=wrench) != []


def test_a_normal_has_any_length_but_0_and_there_are_two_surfaces_at_most():
    assert PlaneParams(normal=(0, 3, 4), distance=0.0, stiffness=1.0).normal == pytest.approx((0.0, 0.6, 0.8))
    with pytest.raises(ValidationError, match="no direction"):
        PlaneParams(normal=(0, 0, 0), distance=0.0, stiffness=1.0)
    with pytest.raises(ValidationError, match="at most 2"):
        TypeAdapter(PlanesParams).validate_python([TABLE, TABLE, TABLE])
