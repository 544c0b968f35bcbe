from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engines.tissue.ports import surface_changes
from schemas.codec import decode, encode
from schemas.ros import Header
from schemas.soft_surface import FaceKind, SoftSurface
from schemas.trocar_msgs import SoftBodyState, SurfaceChange
from tests.engines.tissue.cut_block import EditedSurface

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
NODES = 4


def first_state() -> SoftBodyState:
    nodes = np.zeros(3 * NODES, np.float32)
    return SoftBodyState(
        header=Header(), body="liver", nodes_m=nodes, triangles=TETRAHEDRON.astype(np.uint32).ravel()
    )


def drawn(surface: EditedSurface) -> SoftSurface:
    """The surface as a viewer has it that receives nothing but the first state and the newest change."""
    message = decode(SurfaceChange, encode(surface.change("liver", 0)))
    return SoftSurface.of_first(first_state()).changed(message)


def change_at_random(surface: EditedSurface, data: st.DataObject) -> None:
    count = data.draw(st.integers(1, 5))
    node = st.integers(0, surface.node_count - 1)
    faces = np.array(data.draw(st.lists(st.tuples(node, node, node), min_size=count, max_size=count)))
    kinds = np.array(data.draw(st.lists(st.sampled_from(FaceKind), min_size=count, max_size=count)))
    slots = np.array(data.draw(st.lists(st.integers(0, len(surface.faces) - 1), min_size=1, max_size=count)))
    match data.draw(st.integers(0, 3)):
        case 0:
            surface.add_nodes(faces[:, 0])
        case 1:
            surface.replace(slots, faces[: len(slots)], kinds[: len(slots)])
        case 2:
            assert surface.append(faces, kinds).tolist() == [*range(len(surface.faces))][-count:]
        case _:
            surface.remove(slots)


@given(st.data())
def test_the_newest_change_alone_makes_the_surface(data: st.DataObject) -> None:
    surface = EditedSurface(TETRAHEDRON, NODES)
    for _ in range(data.draw(st.integers(0, 12))):
        change_at_random(surface, data)
        if data.draw(st.booleans()):
            surface.change("liver", 0)
    found = drawn(surface)
    assert np.array_equal(found.faces, surface.faces)
    assert np.array_equal(found.kinds, surface.kinds)
    assert len(found.origins) == surface.node_count
    assert found.origins.max() < NODES


def test_a_copy_of_a_copy_rests_where_the_first_node_does() -> None:
    surface = EditedSurface(TETRAHEDRON, NODES)
    assert surface.add_nodes(np.array([2, 0])).tolist() == [4, 5]
    assert surface.add_nodes(np.array([4, 1])).tolist() == [6, 7]
    assert surface.origins.tolist() == [2, 0, 2, 1]
    assert surface.node_count == 8


def test_faces_without_tissue_are_not_present() -> None:
    surface = EditedSurface(TETRAHEDRON, NODES)
    surface.remove(np.array([1]))
    assert surface.present.tolist() == TETRAHEDRON[[0, 2, 3]].tolist()


def test_an_unchanged_surface_is_the_same_message() -> None:
    """It is encoded once, however often it goes out."""
    surface = EditedSurface(TETRAHEDRON, NODES)
    first = surface.change("liver", 0)
    assert surface.change("liver", 16) is first
    assert not first.slots.size
    assert not first.version
    surface.remove(np.array([0]))
    second = surface.change("liver", 32)
    assert second.header.stamp.nanosec == 32
    assert surface.change("liver", 48) is second


@pytest.mark.parametrize("sent", [False, True])
def test_a_restored_surface_goes_on_with_the_same_bytes(sent: bool) -> None:
    def cut(surface: EditedSurface) -> None:
        twins = surface.add_nodes(np.array([1]))
        surface.append(np.array([[0, 1, twins[0]]]), np.array([FaceKind.CUT]))

    surface, other = (EditedSurface(TETRAHEDRON, NODES) for _ in range(2))
    cut(surface)
    if sent:
        surface.change("liver", 5)
    other.restore(surface.state)
    assert encode(other.change("liver", 10)) == encode(surface.change("liver", 10))
    for one in (surface, other):
        cut(one)
    assert encode(other.change("liver", 20)) == encode(surface.change("liver", 20))


def test_a_saved_state_does_not_change_with_the_surface() -> None:
    surface = EditedSurface(TETRAHEDRON, NODES)
    before = surface.state
    surface.remove(np.array([0]))
    surface.restore(before)
    assert surface.faces.tolist() == TETRAHEDRON.tolist()


def test_it_follows_an_engine_that_keeps_faces_by_slot() -> None:
    surface = EditedSurface(TETRAHEDRON, NODES)
    surface.follow(TETRAHEDRON.astype(np.int32), np.arange(NODES, dtype=np.int32))
    assert surface.version == 0
    faces = np.concatenate([TETRAHEDRON, [[0, 1, 4]]]).astype(np.int32)
    faces[2] = -1
    surface.follow(faces, np.array([0, 1, 2, 3, 1], np.int32))
    assert surface.version == 1
    faces[0] = 0  # the engine goes on to write in its arrays
    found = drawn(surface)
    assert found.faces.tolist() == [[0, 2, 1], [0, 1, 3], [-1, -1, -1], [0, 3, 2], [0, 1, 4]]
    assert found.kinds.tolist() == [0, 0, 0, 0, FaceKind.CUT]
    assert found.origins.tolist() == [0, 1, 2, 3, 1]


def test_the_ports_name_the_organ() -> None:
    class Liver:
        name = "liver"
        surface = EditedSurface(TETRAHEDRON, NODES)

    (port,) = surface_changes([Liver()], 0)  # pyright: ignore[reportArgumentType]
    assert port == "liver/surface"
