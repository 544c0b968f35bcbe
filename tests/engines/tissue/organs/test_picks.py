"""Parts of a surface by normals, boxes and planes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from engines.tissue.meshing.grid import block
from engines.tissue.meshing.tet_mesh import TetMesh
from engines.tissue.organs.anchors import AnchorParams
from engines.tissue.organs.catalogue import SHAPES
from engines.tissue.organs.picks import SurfacePick
from robots import rotation

LIVER = SHAPES["liver-lobe"].mesh(150)
SURFACE = np.zeros(len(LIVER.nodes), np.bool_)
SURFACE[LIVER.triangles] = True
EVERYWHERE = {"low": [-1, -1, -1], "high": [1, 1, 1]}

numbers = st.floats(-1.0, 1.0, allow_nan=False)
directions = st.tuples(numbers, numbers, numbers).filter(lambda v: np.linalg.norm(v) > 0.1)
angles = st.floats(0.02, np.pi)
points = st.tuples(*[st.floats(-0.06, 0.06)] * 3)


def picked(**conditions):
    return SurfacePick.model_validate(conditions).nodes(LIVER)


@given(directions, angles, angles)
def test_a_wider_angle_picks_no_fewer_nodes(direction, one, other):
    narrow, wide = (picked(normal=direction, within=angle) for angle in sorted((one, other)))
    assert not (narrow & ~wide).any()


@given(directions)
def test_all_directions_together_are_the_surface(direction):
    np.testing.assert_array_equal(picked(normal=direction, within=np.pi), SURFACE)
    np.testing.assert_array_equal(picked(box=EVERYWHERE), SURFACE)


def test_six_axes_within_55_degrees_are_the_surface():
    axes = [picked(normal=axis, within="55 deg") for axis in ("+x", "-x", "+y", "-y", "+z", "-z")]
    np.testing.assert_array_equal(np.any(axes, axis=0), SURFACE)


@given(points, directions)
def test_both_sides_of_a_plane_are_the_surface(point, direction):
    here = picked(plane={"point": point, "towards": direction})
    there = picked(plane={"point": point, "towards": [-x for x in direction]})
    np.testing.assert_array_equal(here | there, SURFACE)
    assert not (here & there).any() or np.abs((LIVER.nodes - point) @ direction)[here & there].max() < 1e-9


@given(
    directions,
    angles,
    st.tuples(numbers, numbers, numbers, numbers).filter(lambda q: np.linalg.norm(q) > 0.1),
)
def test_a_pick_turns_with_the_organ(direction, angle, quaternion):
    turn = rotation.matrix(np.array(quaternion) / np.linalg.norm(quaternion))
    turned = TetMesh(LIVER.nodes @ turn.T, LIVER.tetrahedra)
    pick = {"normal": (turn @ direction).tolist(), "within": angle}
    difference = SurfacePick.model_validate(pick).nodes(turned) ^ picked(normal=direction, within=angle)
    assert difference.sum() <= 3  # a face at the very angle


@given(points, directions, angles)
def test_conditions_together_are_their_intersection(point, direction, angle):
    plane = {"point": point, "towards": direction}
    both = picked(normal=direction, within=angle, plane=plane)
    np.testing.assert_array_equal(both, picked(normal=direction, within=angle) & picked(plane=plane))


def test_the_top_of_a_block_is_its_faces_upwards():
    mesh = block(np.array([0.06, 0.06, 0.02]), 100)
    top = SurfacePick.model_validate({"normal": "+z"}).nodes(mesh)
    np.testing.assert_array_equal(top, mesh.nodes[:, 2] == mesh.nodes[:, 2].max())


@pytest.mark.parametrize(
    ("pick", "said"),
    [
        ({"normal": "up"}, "no direction: one of"),
        ({"normal": [0, 0, 0]}, "not all of them 0"),
        ({"within": "20 deg"}, "state `normal`"),
        ({"normal": "-z", "within": "200 deg"}, "less than or equal"),
        ({"plane": {"point": [0, 0, 0]}}, "Field required"),
    ],
)
def test_a_wrong_pick_says_why(pick, said):
    with pytest.raises(ValidationError, match=said):
        SurfacePick.model_validate(pick)


def test_an_anchor_names_a_surface_or_picks_nodes():
    for anchor in ({}, {"surface": "top", "normal": "+z"}):
        with pytest.raises(ValidationError, match="names a surface, or picks nodes"):
            AnchorParams.model_validate(anchor)
