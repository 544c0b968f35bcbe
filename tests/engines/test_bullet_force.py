"""The probe's force against the reaction at the anchors, from the deformed nodes by finite elements."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from engines.bullet.contact import closest_points, contact_gain
from tests.engines.bullet_rig import BLOCK, RADIUS, Rig, params
from tests.engines.finite_elements import internal_forces

TRIANGLES = arrays(float, (5, 3, 3), elements=st.floats(-1, 1))


def reaction(rig, model):
    """Return the force (N) of the anchors on the tissue, shape (3,)."""
    organ = model.organs["block"]
    rest = organ.rest.nodes
    forces = internal_forces(rest, organ.rest.tetrahedra, rig.nodes, *organ.elastic.bullet_lame)
    return -forces[rest[:, 2] == rest[:, 2].min()].sum(axis=0)


def press(model, xy, radius, depths):
    """Return force (N) and reaction (N) at rest at every depth (m)."""
    pairs = []
    with Rig(model, start=(*xy, radius + 1e-3)) as rig:
        rig.hold(0.016)
        before = reaction(rig, model)
        for depth in depths:
            rig.move((*xy, radius - depth), 0.096)
            rig.hold(0.128)
            pairs.append((rig.force, reaction(rig, model) - before))
    return pairs


@pytest.mark.parametrize("xy", [(0.0, 0.0), (5e-3, 0.0), (4e-3, 3e-3), (2e-3, 1e-3), (6e-3, 5e-3)], ids=["node", "edge", "face", "off-node", "off-edge"])
def test_the_force_is_the_reaction_of_the_tissue(xy):
    for force, truth in press(params(BLOCK), xy, RADIUS, (2e-3, 4e-3, 6e-3)):
        assert force[2] == pytest.approx(truth[2], rel=0.06)


@pytest.mark.parametrize(("radius", "nodes", "kilopascal"), [(3e-3, 250, 10), (10e-3, 250, 10), (5e-3, 100, 30), (5e-3, 400, 5)])
def test_the_force_is_the_reaction_for_other_probes_meshes_and_tissues(radius, nodes, kilopascal):
    model = params({**BLOCK, "nodes": nodes, "young_modulus": f"{kilopascal} kPa"}, probe={"radius": radius})
    for force, truth in press(model, (4e-3, 3e-3), radius, (2e-3, 4e-3)):
        assert force[2] == pytest.approx(truth[2], rel=0.08)


def test_a_drag_is_felt_as_much_by_the_tissue():
    model = params(BLOCK)
    with Rig(model, start=(0.0, 0.0, RADIUS + 1e-3)) as rig:
        rig.hold(0.016)
        before = reaction(rig, model)
        rig.move((0.0, 0.0, RADIUS - 3e-3), 0.096)
        wrenches = rig.move((12e-3, 0.0, RADIUS - 3e-3), 0.6)
        truth = reaction(rig, model) - before
    assert wrenches[-1][0] < -0.05  # friction pulls back
    assert np.linalg.norm(wrenches[-1][:3] - truth) < 0.1 * np.linalg.norm(truth)
    assert abs(wrenches[-1][0]) <= 0.5 * wrenches[-1][2]


@settings(deadline=None)
@given(arrays(float, 3, elements=st.floats(-2, 2)), TRIANGLES)
def test_no_point_of_a_triangle_is_nearer_than_the_closest(point, corners):
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    corners = corners[area > 1e-3]
    if len(corners):
        weights, distance = closest_points(point, corners)
        assert weights == pytest.approx(np.clip(weights, 0, 1), abs=1e-9)
        np.testing.assert_allclose(weights.sum(axis=1), 1)
        grid = [(a, b, 1 - a - b) for a in np.linspace(0, 1, 9) for b in np.linspace(0, 1 - a, 9)]
        others = np.linalg.norm(np.einsum("gi,fij->gfj", grid, corners) - point, axis=2)
        assert (distance <= others.min(axis=0) + 1e-9).all()


def test_the_gain_at_a_node_an_edge_a_face_and_out_of_reach():
    nodes, faces = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]]), np.array([[0, 1, 2]])
    at = {"node": nodes[0], "edge": nodes[:2].mean(axis=0), "face": nodes.mean(axis=0)}
    gains = {name: contact_gain(point + np.array([0, 0, 4e-3]), 5e-3, nodes, faces) for name, point in at.items()}
    assert gains == pytest.approx({"node": 1.0, "edge": 9 / 8, "face": 4 / 3})
    assert contact_gain(at["face"] + np.array([0, 0, 7e-3]), 5e-3, nodes, faces) == 1.0
