from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engines.bullet.organ import Organ
from engines.bullet.world import connect, disconnect
from engines.tissue.meshing.grid import FEWEST_NODES, block, block_cells
from engines.tissue.meshing.tet_mesh import volumes
from engines.tissue.organs.params import OrganParams

SIZES = st.tuples(*3 * [st.floats(5e-3, 0.2)]).map(np.array)
NODES = st.integers(FEWEST_NODES, 600)


@given(SIZES, NODES)
def test_a_block_is_filled_exactly_by_positive_tetrahedra(size, nodes):
    mesh = block(size, nodes)
    volume = volumes(mesh.nodes, mesh.tetrahedra)
    assert (volume > 0).all()
    assert volume.sum() == pytest.approx(np.prod(size), rel=1e-12)
    assert len(np.unique(mesh.tetrahedra)) == len(mesh.nodes)


@given(SIZES, NODES)
def test_the_node_count_is_near_the_request(size, nodes):
    count = len(block(size, nodes).nodes)
    assert count == np.prod(np.add(block_cells(size, nodes), 1))
    assert abs(count / nodes - 1) < 0.2


@given(SIZES, NODES)
def test_the_surface_is_closed_and_faces_outwards(size, nodes):
    mesh = block(size, nodes)
    edges = Counter(
        (a, b) for face in mesh.triangles.tolist() for a, b in zip(face, face[1:] + face[:1], strict=True)
    )
    assert all(count == 1 and edges[b, a] == 1 for (a, b), count in edges.items())
    a, b, c = (mesh.nodes[mesh.triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    # divergence theorem
    assert np.einsum("ij,ij->", a, normals) / 6 == pytest.approx(np.prod(size), rel=1e-9)
    assert np.linalg.norm(normals, axis=1).sum() / 2 == pytest.approx(
        2 * (size[0] * size[1] + size[1] * size[2] + size[0] * size[2]), rel=1e-9
    )


@pytest.mark.long
@given(SIZES, NODES, st.sampled_from([0, 1]))
def test_a_block_is_its_own_mirror_image(size, nodes, axis):
    mesh = block(size, nodes)
    grid = np.rint(mesh.nodes / (size / block_cells(size, nodes)) * 2).astype(int)
    mirrored = grid * np.where(np.arange(3) == axis, -1, 1)
    assert {frozenset(map(tuple, t)) for t in grid[mesh.tetrahedra].tolist()} == {
        frozenset(map(tuple, t)) for t in mirrored[mesh.tetrahedra].tolist()
    }


def test_the_demo_block():
    assert block_cells(np.array([0.08, 0.06, 0.02]), 250) == (8, 8, 2)


def test_bullet_keeps_the_order_and_every_bit_of_the_nodes():
    params = OrganParams.model_validate(
        {
            "size": ["80 mm", "60 mm", "20 mm"],
            "young_modulus": "10 kPa",
            "position": ["10 mm", "-7 mm", "33.3 mm"],
        }
    )
    client = connect("test", 1e-3, 9.81)
    try:
        organ = Organ("block", params, client)
        np.testing.assert_array_equal(organ.nodes, params.rest.nodes)
        assert organ.nodes[~organ.anchored].max(axis=0) == pytest.approx([0.05, 0.023, 0.0333])
        assert organ.nodes[organ.anchored][:, 2] == pytest.approx(0.0133)
    finally:
        disconnect(client)
