"""Frames: what goes in comes out, and what is not a frame is refused."""

import json
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from schemas.errors import MessageError
from schemas.ros import Header
from tests.webconsole.recorded_scene import markers
from webconsole.frame import (
    Section,
    SectionKind,
    frame,
    node_content,
    parse_acknowledgement,
    pose_content,
    sections,
)
from webconsole.markers import marker_content

PARTS = st.lists(
    st.builds(Section, st.sampled_from(SectionKind), st.integers(0, 65535), st.binary(max_size=65))
)


@given(st.integers(0, 2**32 - 1), st.integers(-(2**63), 2**63 - 1), PARTS)
def test_a_frame_comes_back(number, time_ns, parts):
    data = frame(number, time_ns, parts)
    assert sections(data) == (number, time_ns, parts)
    assert len(data) % 8 == 0


def test_poses_and_nodes_are_as_exact_as_they_say():
    rng = np.random.default_rng(0)
    poses = rng.normal(size=(50, 7)).astype(np.float32)
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    data = pose_content(poses)
    assert np.array_equal(np.frombuffer(data, "<f4", 150).reshape(50, 3), poses[:, :3])
    turns = np.frombuffer(data, "<i2", offset=600).reshape(50, 4) / 32767.0
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    angle = 2.0 * np.arccos(np.minimum(np.abs((turns * poses[:, 3:]).sum(axis=1)), 1.0))
    assert angle.max() < 1e-3
    assert np.abs(turns - poses[:, 3:]).max() < 3e-5
    nodes = (0.2 * rng.random((300, 3))).astype(np.float32)
    data = node_content(nodes)
    low, step = np.frombuffer(data, "<f4", 6).reshape(2, 3)
    back = low + step * np.frombuffer(data, "<u2", offset=24).reshape(3, 300).T
    assert np.abs(back - nodes).max() < 1.6e-6
    flat = np.frombuffer(node_content(np.zeros((2, 3), np.float32)), "<u2", offset=24)
    assert not flat.any()


@given(st.binary(max_size=80))
def test_what_is_not_a_frame_is_refused(data):
    with pytest.raises(MessageError):
        sections(data)


@given(PARTS.filter(bool), st.data())
def test_a_frame_cut_short_is_refused(parts, data):
    whole = frame(1, 2, parts)
    padding = -len(parts[-1].content) % 8
    cut = data.draw(st.integers(0, len(whole) - padding - 1))
    with pytest.raises(MessageError):
        sections(whole[:cut])


def test_an_acknowledgement_has_four_bytes():
    assert parse_acknowledgement(struct.pack("<I", 7)) == 7
    with pytest.raises(MessageError, match="3 bytes, expected 4"):
        parse_acknowledgement(b"abc")


def test_markers_whose_parts_do_not_fit_are_rejected():
    shown = markers(Header(frame_id="world"))
    content = marker_content(shown)
    size = struct.unpack_from("<I", content)[0]
    rows = json.loads(content[4 : 4 + size])
    assert [row["type"] for row in rows] == shown.types.tolist()
    numbers = np.frombuffer(content, "<f4", offset=4 + size)
    assert len(numbers) == 14 * len(rows) + shown.points_m.size
    assert np.allclose(numbers[: 7 * len(rows)], shown.poses)
    for part in ("poses", "point_counts", "texts", "color_counts"):
        value = getattr(shown, part)
        cut = np.append(value[1:], 2).astype(value.dtype) if part.endswith("counts") else value[1:]
        with pytest.raises(MessageError, match="other sizes"):
            marker_content(shown.model_copy(update={part: cut}))


@pytest.mark.parametrize("nodes", [[0.0, 1.0], [0.0, np.nan, 0.0], [np.inf, 0.0, 0.0]])
def test_what_are_no_nodes_is_refused(nodes):
    with np.errstate(invalid="ignore"), pytest.raises(MessageError):
        node_content(np.array(nodes, np.float32))
