"""Ways to take hold: where the fingers come, by plain geometry."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.expert import outlines, reach
from controllers.expert.grasps import AMPLE_ROOM, grasps_of_piece, grasps_of_ring, shut_fingers
from controllers.expert.peg_board import PegBoard
from hub.planning.scenario_file import load
from robots.dvrk.instruments import instrument
from robots.dvrk.psm import chain
from robots.training.boards import BOARDS
from robots.training.dishes import PIECE

DRIVER, CADIERE = 10.2e-3, 15.5e-3
ANGLES = st.floats(-np.pi, np.pi)


def turned(angle, axis=2, position=(0.1, 0.2, 0.3)):
    pose, (i, j) = np.eye(4), ((1, 2), (2, 0), (0, 1))[axis]
    pose[[i, i, j, j], [i, j, i, j]] = np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)
    pose[:3, 3] = position
    return pose


@given(ANGLES)
def test_a_standing_piece_is_taken_across_either_side_with_room_to_come_down(angle):
    pose = turned(angle)
    found = grasps_of_piece(pose, CADIERE)
    assert len(found.poses) == 4
    for tip, opening in zip(found.poses, found.opening, strict=True):
        assert tip[:3, 2] == pytest.approx([0, 0, -1])
        assert tip[:2, 3] == pytest.approx(pose[:2, 3])
        across = np.abs(pose[:3, :3].T @ tip[:3, 1])
        half = PIECE.size[int(across.argmax())] / 2
        assert across.max() == pytest.approx(1.0)
        over = tip[2, 3] - (pose[2, 3] + PIECE.size[2] / 2)
        assert over * np.tan(opening / 2) == pytest.approx(half + 2e-3)  # 2 mm to either side
        assert np.hypot(half, over) == pytest.approx(CADIERE - 1e-3)  # the edges touch 1 mm from the ends


def test_a_short_jaw_takes_a_piece_across_its_narrow_side_alone():
    found = grasps_of_piece(turned(0.0), DRIVER)
    assert np.abs(found.poses[:, 0, 1]) == pytest.approx(1.0)


@given(ANGLES, st.sampled_from(sorted(BOARDS)), st.floats(0, 1e-3), ANGLES)
def test_a_ring_around_its_post_can_be_taken_and_no_finger_comes_down_on_the_post(angle, name, off, where):
    board = BOARDS[name]
    pose = turned(angle)
    post = pose[:2, 3] + off * np.array([np.cos(where), np.sin(where)])
    found = grasps_of_ring(board.ring, pose, DRIVER, (post, board.post_radius))
    assert len(found.poses)
    for tip, opening in zip(found.poses, found.opening, strict=True):
        inwards = pose[:2, 3] - tip[:2, 3]
        way = tip[:2, 1] * np.sign(tip[:2, 1] @ inwards)
        # the finger in the hole, at its end: a rectangle of 1.4 mm by 4.2 mm behind the pad
        middle = tip[:2, 3] + way * (DRIVER * np.sin(opening / 2) + 0.7e-3)
        off_axes = np.abs([way @ (post - middle), np.array([-way[1], way[0]]) @ (post - middle)])
        assert np.linalg.norm(np.maximum(off_axes - [0.7e-3, 2.1e-3], 0)) > board.post_radius


@given(ANGLES, st.floats(0, 0.55))
def test_the_wall_of_a_ring_lies_in_the_plane_between_the_fingers(angle, lean):
    ring, pose = BOARDS["icra2026"].ring, turned(angle)
    found = grasps_of_ring(ring, pose, DRIVER, None, lean).poses
    assert len(found) >= 12
    for tip in found:
        assert tip[:3, :3].T @ tip[:3, :3] == pytest.approx(np.eye(3), abs=1e-12)
        across = abs(tip[:2, 1] @ (tip[:2, 3] - pose[:2, 3]))
        assert across == pytest.approx(ring.inradius + ring.thickness / 2)
        ends = tip[:3, 3] + DRIVER * tip[:3, 2]
        rim = ends - 5e-3 / np.cos(lean) * tip[:3, 2]
        assert rim[2] == pytest.approx(pose[2, 3] + ring.height / 2)


@given(ANGLES, st.floats(0, 0.55))
def test_the_finger_in_a_ring_keeps_clear_of_its_other_walls(angle, lean):
    ring, pose = BOARDS["surrol"].ring, turned(angle)
    found = grasps_of_ring(ring, pose, DRIVER, None, lean)
    assert len(found.poses)
    corners = np.array([[np.cos(a), np.sin(a)] for a in np.pi / 2 + 2 * np.pi / 3 * np.arange(3)])
    normals = -corners @ pose[:2, :2].T  # of the walls: opposite to the corners
    for tip, room in zip(found.poses, found.room, strict=True):
        inwards = np.sign(tip[:2, 1] @ (pose[:2, 3] - tip[:2, 3])) * tip[:2, 1]
        sideways = np.array([-inwards[1], inwards[0]])
        for along in (0.0, 5e-3 / np.cos(lean)):  # the end of the finger, and where it passes the rim
            ends = tip[:2, 3] + (DRIVER - along) * tip[:2, 2] + (DRIVER - along) * np.sin(0.1) * inwards
            edges = [ends + 1.4e-3 * inwards + side * 2.1e-3 / np.cos(lean) * sideways for side in (-1, 1)]
            other = [n for n in normals if n @ inwards > -0.9]
            gaps = [ring.inradius - n @ (edge - pose[:2, 3]) for n in other for edge in edges]
            assert min(gaps) > 0.3e-3 - 1e-9
            assert min(gaps) >= room - 1e-9


def test_the_finger_outside_keeps_clear_of_a_ring_beside():
    ring, pose = BOARDS["surrol"].ring, turned(0.3)
    beside = outlines.outline_of_ring(ring, turned(0.3 + np.pi, position=(0.1 + 0.0125, 0.2, 0.3)))
    free, clear = (grasps_of_ring(ring, pose, DRIVER, None, others=others) for others in ([], [beside]))
    assert 0 < len(clear.poses) < len(free.poses)
    for tip in clear.poses:
        outwards = np.sign(tip[:2, 1] @ (tip[:2, 3] - pose[:2, 3])) * tip[:2, 1]
        end = tip[:2, 3] + outwards * (DRIVER * np.sin(0.1) + 0.7e-3)
        finger = end + 0.5e-3 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        assert outlines.outline_gap(beside, finger) > 0.0


@given(ANGLES, st.sampled_from(sorted(BOARDS)), st.integers(0, 29))
def test_a_second_hand_finds_room_beside_the_fingers_of_the_first(angle, name, which):
    ring, pose = BOARDS[name].ring, turned(angle)
    ways = grasps_of_ring(ring, pose, DRIVER, None).poses
    first = shut_fingers(ways[which % len(ways)], DRIVER, ring.thickness)
    found = grasps_of_ring(ring, pose, DRIVER, None, others=[first])
    assert len(found.poses)
    for tip in found.poses:
        both = [tip[:2, 3] + side * (DRIVER * np.sin(0.1) + 0.7e-3) * tip[:2, 1] for side in (-1, 1)]
        square = 0.5e-3 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        assert min(outlines.outline_gap(first, end + square) for end in both) > 0.0


def test_the_room_between_outlines():
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float64)
    assert outlines.outline_gap(square, square + np.array([3, 0.5])) == pytest.approx(2)
    assert outlines.outline_gap(square, square + np.array([0.75, 0.5])) == pytest.approx(-0.25)


@given(ANGLES, st.sampled_from(sorted(BOARDS)), st.floats(0, 0.55))
def test_the_finger_of_a_leaning_hand_passes_a_post_that_is_higher_than_the_ring(angle, name, lean):
    board = BOARDS[name]
    pose = turned(angle)
    for tip in grasps_of_ring(board.ring, pose, DRIVER, (pose[:2, 3], board.post_radius), lean).poses:
        inwards = np.sign(tip[:2, 1] @ (pose[:2, 3] - tip[:2, 3])) * tip[:2, 1]
        for along in np.linspace(0.0, DRIVER, 5):  # from the end of the finger, its inner face and edges
            middle = tip[:3, 3] + (DRIVER - along) * (np.append(inwards, 0) * np.sin(0.1) + tip[:3, 2])
            post = (pose[:3, 3] - middle)[:2] - 0.7e-3 * inwards
            off = np.abs([inwards @ post, np.array([-inwards[1], inwards[0]]) @ post])
            gap = np.linalg.norm(np.maximum(off - [0.7e-3, 2.1e-3 / np.cos(lean)], 0))
            assert gap > board.post_radius


def test_a_ring_on_its_side_is_not_taken_from_above():
    assert not len(grasps_of_ring(BOARDS["icra2026"].ring, turned(np.pi / 2, axis=0), DRIVER, None).poses)


@given(ANGLES, st.floats(0.4, 1.1))
def test_a_leaning_piece_is_taken_along_its_own_axes(angle, lean):
    pose = turned(angle) @ turned(lean, axis=0, position=(0, 0, 0))
    found = grasps_of_piece(pose, CADIERE)
    assert len(found.poses)
    for tip, up in zip(found.poses, found.ups, strict=True):
        assert tip[:3, 2] == pytest.approx(-up)
        assert up[2] >= 0.5
        assert np.abs(pose[:3, :3].T @ up).max() == pytest.approx(1.0)


@given(st.lists(st.floats(-0.5, 0.5), min_size=5, max_size=5), st.floats(0.1, 0.2))
def test_the_links_of_an_instrument_go_from_its_wrist_up_through_the_remote_centre(angles, insertion):
    arm = chain(instrument("400006"))
    base = turned(0.7)
    q = np.array([angles[0], angles[1], insertion, *angles[2:]])
    points = reach.links(arm, base, q[None])[0]
    tip, centre = base @ arm.forward(q), base[:3, 3]
    assert points[0] == pytest.approx(tip[:3, 3])  # the wrist yaw axis
    assert np.linalg.norm(points[4] - points[0]) == pytest.approx(9.1e-3)
    shaft = points[5:] - centre
    assert np.linalg.norm(np.cross(shaft, shaft[0]), axis=1) == pytest.approx(0, abs=1e-12)
    assert np.linalg.norm(shaft[-1]) < np.linalg.norm(shaft[0])


def test_a_wrist_has_no_room_where_a_post_stands():
    params = load("peg-board-surrol", []).params["lead"]
    board = PegBoard(params.rings, params.board)
    top = board._posts[0] + np.array([0, 0, 0.005])
    points = np.tile(top + np.array([[[0.02, 0, 0]], [[0.004, 0, 0]], [[0, 0, 0]]]), (1, 22, 1))
    free, near, inside = board.room(points)
    assert inside < near < free <= AMPLE_ROOM
