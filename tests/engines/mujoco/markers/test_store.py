"""Which markers are shown after messages, and what is rejected with which reason."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engines.mujoco.markers import store as store_module
from engines.mujoco.markers.store import MarkerStore, shown_markers
from robots import rotation
from schemas.codec import decode, encode
from schemas.errors import MessageError
from schemas.ros import Header, Point, Pose, Quaternion, Vector3
from schemas.trocar_msgs import ShownMarkers
from schemas.vectors import Vector
from schemas.visualization import (
    ColorRGBA,
    DurationMessage,
    Marker,
    MarkerAction,
    MarkerArray,
    MarkerType,
    MeshFile,
)

TIP = np.array([[0.0, -1.0, 0.0, 0.1], [1.0, 0.0, 0.0, 0.2], [0.0, 0.0, 1.0, 0.3], [0.0, 0.0, 0.0, 1.0]])
"""Where the frame `PSM1` is."""


def pose_of(frame: str) -> Vector:
    return TIP if frame == "PSM1" else np.eye(4)


def make() -> MarkerStore:
    return MarkerStore(("world", "PSM1_base", "PSM1", "needle"), ("world", "PSM1_base"), ("needle",))


def marker(number: int = 0, **changes: object) -> Marker:
    fields: dict[str, object] = {
        "header": Header(frame_id="world"),
        "ns": "a",
        "id": number,
        "type": MarkerType.SPHERE,
        "scale": Vector3(x=1e-3, y=1e-3, z=1e-3),
        "color": ColorRGBA(b=1.0, a=1.0),
    }
    return Marker.model_validate(fields | changes)


def send(store: MarkerStore, *markers: Marker, t_ns: int = 0) -> list[str]:
    return store.apply(MarkerArray(markers=list(markers)), t_ns, pose_of)


def names(store: MarkerStore) -> list[tuple[str, int]]:
    return list(zip(store.shown.namespaces, store.shown.ids.tolist(), strict=True))


def stl(corners: list[float]) -> bytes:
    body = np.array([0.0, 0.0, 1.0, *corners], "<f4").tobytes() + b"\0\0"
    return bytes(80) + (1).to_bytes(4, "little") + body


def test_markers_are_added_changed_and_deleted_in_the_order_of_the_message() -> None:
    store = make()
    assert send(store, marker(1), marker(2), marker(1, ns="b")) == []
    red = marker(2, color=ColorRGBA(r=1.0, a=1.0), action=MarkerAction.ADD)
    assert send(store, marker(1, action=MarkerAction.DELETE), red, marker(3)) == []
    assert names(store) == [("a", 2), ("b", 1), ("a", 3)]
    assert store.shown.colors.reshape(-1, 4)[0].tolist() == [1.0, 0.0, 0.0, 1.0]
    send(store, marker(9, action=MarkerAction.DELETE))  # there is none: nothing happens
    send(store, marker(ns="a", action=MarkerAction.DELETEALL))
    assert names(store) == [("b", 1)]
    send(store, marker(ns="", action=MarkerAction.DELETEALL), marker(7))
    assert names(store) == [("a", 7)]


def test_clips_of_an_organ_are_of_metal_and_signs_are_not() -> None:
    store = make()
    send(store, marker(1, ns="cystic_duct/clips"), marker(2, ns="goal"))
    assert [one.is_metal for one in shown_markers(store.shown)] == [True, False]


def test_a_lifetime_ends_in_simulated_time() -> None:
    store = make()
    send(store, marker(1, lifetime=DurationMessage.from_ns(500)), marker(2), t_ns=1000)
    before = store.shown
    store.expire(1499)
    assert store.shown is before
    store.expire(1500)
    assert names(store) == [("a", 2)]
    assert store.shown.header.stamp.ns == 1500
    send(store, marker(2, lifetime=DurationMessage.from_ns(10)), t_ns=2000)  # a new message sets it anew
    store.expire(2010)
    assert names(store) == []


def test_a_locked_marker_stays_in_its_frame_and_another_in_the_world() -> None:
    store = make()
    pose = Pose(position=Point(x=0.01), orientation=Quaternion(z=np.sqrt(0.5), w=np.sqrt(0.5)))
    frame = Header(frame_id="PSM1")
    send(
        store,
        marker(1, header=frame, pose=pose, frame_locked=True),
        marker(2, header=frame, pose=pose),
        marker(3, header=Header(frame_id="PSM1_base")),  # never moves
    )
    locked, free, fixed = shown_markers(store.shown)
    assert [one.frame for one in (locked, free, fixed)] == ["PSM1", "world", "PSM1_base"]
    np.testing.assert_allclose(free.pose[:3], (TIP @ [0.01, 0.0, 0.0, 1.0])[:3], atol=1e-15)
    turned = TIP[:3, :3] @ rotation.matrix(locked.pose[3:])
    np.testing.assert_allclose(rotation.matrix(free.pose[3:]), turned, atol=1e-12)


POINTS = [Point(x=float(i)) for i in range(4)]


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"header": Header(frame_id="PSM2")}, r"frame_id 'PSM2' is no frame .* Did you mean 'PSM1'"),
        ({"header": Header()}, "frame_id '' is no frame of this scene"),
        ({"type": 13}, "type 13 is unknown"),
        ({"action": 1}, "action 1; allowed are 0"),
        ({"pose": Pose(orientation=Quaternion(w=0.5))}, r"norm 0\.5, expected 1 within 0\.001"),
        ({"pose": Pose(position=Point(x=1000.0))}, "more than 100 m from its frame"),
        ({"scale": Vector3(x=1.0, y=0.0, z=1.0)}, r"scale\.y of SPHERE is 0 m"),
        ({"scale": Vector3(x=-1.0, y=1.0, z=1.0)}, r"scale\.x of SPHERE is -1 m"),
        ({"color": ColorRGBA(r=255.0, a=1.0)}, "all from 0 to 1"),
        ({"lifetime": DurationMessage(sec=-1)}, "lifetime -1 s is below 0"),
        (
            {"type": MarkerType.LINE_STRIP, "points": POINTS[:1]},
            "LINE_STRIP with 1 points; it needs at least 2",
        ),
        ({"type": MarkerType.LINE_LIST, "points": POINTS[:3]}, "at least 2, a multiple of 2"),
        ({"type": MarkerType.ARROW, "points": POINTS[:3]}, "an ARROW with 3 points"),
        ({"type": MarkerType.POINTS, "points": POINTS, "colors": [ColorRGBA()]}, "1 colors for 4 points"),
        ({"type": MarkerType.TEXT_VIEW_FACING}, "a text of 0 letters"),
        ({"type": MarkerType.TEXT_VIEW_FACING, "text": "x" * 257}, "a text of 257 letters"),
        ({"type": MarkerType.MESH_RESOURCE, "mesh_resource": "file:///etc/passwd"}, "files are not read"),
        (
            {"type": MarkerType.MESH_RESOURCE, "mesh_file": MeshFile(data=np.zeros(90, np.uint8))},
            "no binary STL",
        ),
        ({"texture_resource": "wood"}, "textures are not drawn"),
        (
            {"header": Header(frame_id="x" * 9)},
            "no frame of this scene. Known: PSM1, PSM1_base, needle, world",
        ),
    ],
)
def test_what_cannot_be_shown_is_rejected_and_the_rest_is_shown(
    changes: dict[str, object], reason: str
) -> None:
    store = make()
    (told,) = send(store, marker(1), marker(2, **changes), marker(3))
    assert told.startswith("marker 'a' 2: ")
    with pytest.raises(MessageError, match=reason):
        raise MessageError(told)
    assert names(store) == [("a", 1), ("a", 3)]


def test_a_message_of_which_nothing_is_taken_changes_nothing() -> None:
    store = make()
    send(store, marker(1))
    before = store.shown
    assert len(send(store, marker(1, type=13), t_ns=5)) == 1
    assert store.shown is before


def test_no_more_markers_and_points_than_there_is_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store_module, "MOST_MARKERS", 2)
    monkeypatch.setattr(store_module, "MOST_POINTS", 10)
    store = make()
    (told,) = send(store, marker(1), marker(2), marker(3), marker(1, ns="a"))
    assert "marker 'a' 3: 2 markers are shown, and no more are allowed" in told
    many = {"type": MarkerType.POINTS, "points": POINTS * 2}
    (told,) = send(store, marker(1, **many), marker(2, **many))
    assert "16 points and letters in all; allowed are 10" in told
    assert send(store, marker(1, **many)) == []  # in place of itself
    assert send(store, marker(1), marker(2, **many)) == []


def test_a_long_namespace_is_rejected_and_not_repeated() -> None:
    (told,) = send(make(), marker(ns="x" * 300))
    assert "a namespace of 300 letters; allowed are 256" in told
    assert "x" * 41 not in told


def test_zeros_are_no_turn_as_programs_of_ros_1_begin() -> None:
    store = make()
    assert send(store, marker(pose=Pose(orientation=Quaternion(w=0.0)))) == []
    assert store.shown.poses.tolist() == [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]


def test_a_mesh_of_a_program_becomes_triangles() -> None:
    store, corners = make(), [0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.02, 0.0]
    mesh = MeshFile(data=np.frombuffer(stl(corners), np.uint8))
    assert send(store, marker(type=MarkerType.MESH_RESOURCE, mesh_file=mesh)) == []
    (shown,) = shown_markers(store.shown)
    assert shown.type is MarkerType.TRIANGLE_LIST
    np.testing.assert_allclose(shown.points.ravel(), corners, atol=1e-9)
    (told,) = send(
        store,
        marker(
            type=MarkerType.MESH_RESOURCE,
            mesh_file=MeshFile(data=np.frombuffer(stl([np.nan, *corners[1:]]), np.uint8)),
        ),
    )
    assert "not finite" in told


@st.composite
def any_marker(draw: st.DrawFn) -> Marker:
    near = st.floats(-1.0, 1.0)
    points = st.lists(st.builds(Point, x=near, y=near, z=near), min_size=2, max_size=4)
    kind = draw(st.sampled_from((MarkerType.SPHERE, MarkerType.LINE_STRIP, MarkerType.TEXT_VIEW_FACING)))
    strip = draw(points) if kind is MarkerType.LINE_STRIP else []
    share = st.floats(0.0, 1.0)
    return marker(
        draw(st.integers(0, 5)),
        ns=draw(st.sampled_from(("a", "b"))),
        header=Header(frame_id=draw(st.sampled_from(("world", "PSM1", "needle")))),
        type=kind,
        action=draw(st.sampled_from((0, 0, 0, 2, 3))),
        points=strip,
        colors=[ColorRGBA(r=draw(share), a=1.0) for _ in strip] if draw(st.booleans()) else [],
        text="word",
        frame_locked=draw(st.booleans()),
        lifetime=DurationMessage.from_ns(draw(st.integers(0, 3))),
    )


@given(st.lists(st.lists(any_marker(), max_size=4), max_size=5))
def test_a_store_that_was_restored_goes_on_as_the_first(arrays: list[list[Marker]]) -> None:
    first, second = make(), make()
    for t_ns, markers in enumerate(arrays):
        second.restore(decode(ShownMarkers, encode(first.shown)))
        for store in (first, second):
            assert send(store, *markers, t_ns=t_ns) == []
            store.expire(t_ns + 1)
        assert encode(first.shown) == encode(second.shown)


def test_parts_that_do_not_fit_together_are_no_markers() -> None:
    store = make()
    send(store, marker(1))
    with pytest.raises(MessageError, match="do not fit together"):
        list(shown_markers(store.shown.model_copy(update={"poses": np.zeros(6)})))
