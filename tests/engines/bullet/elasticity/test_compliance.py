"""The compliance of a surface: of the mesh, against its stiffness; of the body, against a layer's."""

from math import pi

import numpy as np
import pytest

from engines.tissue.elasticity.body_yield import BodyYield
from engines.tissue.elasticity.compliance import SurfaceCompliance
from engines.tissue.elasticity.dense_body_yield import DenseBodyYield
from engines.tissue.elasticity.sparse_inverse import levels_of
from engines.tissue.organs.params import OrganParams
from tests.engines.bullet.finite_elements import Elements
from tests.engines.bullet.rig import BLOCK, SMALL_BLOCK

DOWN = np.array([0.0, 0.0, -1.0])


def surface(block, body_yield=DenseBodyYield):
    organ = OrganParams.model_validate(block)
    anchored = np.any(list(organ.anchored_nodes.values()), axis=0)
    faces = organ.rest.triangles[~anchored[organ.rest.triangles].all(axis=1)]
    compliance = SurfaceCompliance(organ.rest, anchored, faces, organ.elastic, body_yield=body_yield)
    return organ, anchored, compliance


def top_near(organ, x, y, count=1):
    nodes = organ.rest.nodes
    top = np.flatnonzero(nodes[:, 2] == nodes[:, 2].max())
    return top[np.argsort(np.linalg.norm(nodes[top, :2] - [x, y], axis=1), kind="stable")[:count]]


def test_a_force_moves_nodes_as_the_stiffness_of_the_elements_says():
    organ, anchored, compliance = surface(SMALL_BLOCK)
    pressed = top_near(organ, 0.0, 0.0, count=4)
    mesh = organ.rest
    elements = Elements(mesh.nodes, mesh.tetrahedra, *organ.elastic.neo_hookean_lame)
    size = mesh.nodes.size
    stiffness = np.zeros((size, size))
    for tetrahedron, block in zip(mesh.tetrahedra, elements.stiffness(mesh.nodes), strict=True):
        at = (3 * tetrahedron[:, None] + np.arange(3)).ravel()
        stiffness[np.ix_(at, at)] += block.reshape(12, 12)
    free = np.flatnonzero(np.repeat(~anchored, 3))
    forces = np.zeros((size, 4))
    forces[3 * pressed + 2, range(4)] = -1.0
    moved = np.zeros_like(forces)
    moved[free] = np.linalg.solve(stiffness[np.ix_(free, free)], forces[free])
    expected = -moved[3 * pressed + 2]
    found = compliance.of_mesh(pressed, DOWN)
    np.testing.assert_allclose(found, expected, atol=1e-5 * expected.max())


@pytest.mark.parametrize("nodes", [250, 600])
def test_a_block_is_stiffer_than_a_half_space_as_a_bonded_layer_is(nodes):
    # Dimitriadis et al., Biophys. J. 82 (2002), 2798: F = F_Hertz (1 - 2 a/pi chi + ...), chi = contact
    # radius over thickness; at a given force the first term is a yield of a / (pi E* thickness) (1 N).
    organ, _, compliance = surface({**BLOCK, "nodes": nodes})
    nu, thickness = organ.elastic.poisson_ratio, 20e-3
    a = -(1.2876 - 1.4678 * nu + 1.3442 * nu**2) / (1 - nu)
    expected = a / (pi * thickness * organ.elastic.young_modulus / (1 - nu**2))
    found = compliance.of_body(top_near(organ, 0.0, 0.0), np.ones(1))
    assert found == pytest.approx(expected, rel=0.04)


def test_near_a_free_edge_the_body_gives_way_more():
    organ, _, compliance = surface(BLOCK)
    middle, near_the_edge = top_near(organ, 0.0, 0.0), top_near(organ, 32e-3, 0.0)
    assert compliance.of_body(near_the_edge, np.ones(1)) > compliance.of_body(middle, np.ones(1))


@pytest.mark.parametrize("block", [BLOCK, {"shape": "liver-lobe", "nodes": 200}])
def test_the_sparse_inverse_has_the_compliance_of_the_dense(block):
    organ, _, dense = surface(block)
    _, _, sparse = surface(block, BodyYield)
    nodes = np.unique(organ.rest.triangles)
    nodes = sparse.on_surface(nodes)
    expected = dense.between(nodes)
    np.testing.assert_allclose(sparse.between(nodes), expected, atol=3e-6 * np.abs(expected).max())
    for node in nodes.tolist():
        both = (one.of_body(np.array([node]), np.ones(1)) for one in (sparse, dense))
        assert next(both) == pytest.approx(next(both), rel=1e-4, abs=1e-3 * expected.max())


def test_two_parts_that_do_not_touch_have_levels_one_after_the_other():
    mesh = OrganParams.model_validate(SMALL_BLOCK).rest
    count = len(mesh.nodes)
    nodes = np.concatenate([mesh.nodes, mesh.nodes + np.array([0.2, 0.0, 0.0])])
    pairs = np.argwhere(np.ones((count, count)))
    level = levels_of(nodes, np.concatenate([pairs, pairs + count]), np.ones(2 * count, bool))
    assert level.min() == 0
    assert level[:count].max() < level[count:].min()
