"""Normals and tangents of drawn vertices."""

from __future__ import annotations

import numpy as np
import pytest

from engines.mujoco.pictures.filament.tangent_frames import TangentFrames
from robots import rotation

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize(
    "vector", [[0.0, 0.0, 0.0], [0.0, 0.0, 3.0], [3.1, 0.0, 0.0], [0.0, 2.5, 0.4], [1.0, -2.0, 0.5]]
)
def test_the_frame_turns_with_the_surface(vector: list[float]) -> None:
    frames = TangentFrames(FACES, np.zeros(2, np.int64))
    frames.set_uv(SQUARE[frames.source, :2].astype(np.float32))
    turn = rotation.matrix(rotation.exp(np.array(vector)))
    drawn = frames.vertices(SQUARE @ turn.T)
    assert np.allclose(drawn[:, :3], (SQUARE @ turn.T)[frames.source], atol=1e-6)
    assert np.allclose(drawn[:, 7:], SQUARE[frames.source, :2])
    for quaternion in drawn[:, 3:7]:
        assert quaternion[3] > 0.0  # not mirrored
        assert np.allclose(rotation.matrix(quaternion.astype(float)), turn, atol=1e-3)


def test_a_vertex_where_charts_meet_has_one_normal_and_two_places_in_the_texture() -> None:
    bent = SQUARE.copy()
    bent[1, 2] = 1.0
    frames = TangentFrames(FACES, np.array([0, 1]))
    assert len(frames.source) == 6
    uv = SQUARE[frames.source, :2] + frames.chart[:, None]
    frames.set_uv(uv.astype(np.float32))
    drawn = frames.vertices(bent)
    normals = np.array([rotation.matrix(q.astype(float))[:, 2] for q in drawn[:, 3:7]])
    for vertex in (0, 2):
        one, other = np.flatnonzero(frames.source == vertex)
        assert np.allclose(normals[one], normals[other], atol=1e-5)
        assert not np.allclose(drawn[one, 7:], drawn[other, 7:])
