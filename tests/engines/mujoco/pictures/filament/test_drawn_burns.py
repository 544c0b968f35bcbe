"""Kinds of tissue inside of cuts: below the coats, and around a node."""

from __future__ import annotations

import numpy as np

from engines.mujoco.pictures.filament.drawn_burns import _edge, burnt_shares, mostly
from schemas.soft_surface import FaceKind

STRIP = np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]])


def test_a_node_has_the_share_of_burnt_faces_around_it() -> None:
    kinds = np.array([FaceKind.CUT, FaceKind.COAGULATED, FaceKind.CHARRED, FaceKind.CHARRED], np.uint8)
    shares = burnt_shares(STRIP, kinds, 7)
    assert np.allclose(shares[FaceKind.COAGULATED], [0.0, 0.5, 2 / 3, 1.0, 1.0, 1.0, 0.0])
    assert np.allclose(shares[FaceKind.CHARRED], [0.0, 0.0, 1 / 3, 2 / 3, 1.0, 1.0, 0.0])
    assert mostly(shares, STRIP).tolist() == [FaceKind.CUT, FaceKind.CUT, FaceKind.CUT, FaceKind.COAGULATED]


def test_a_coat_covers_whole_shares_and_has_a_ragged_edge_between() -> None:
    opacity = _edge(FaceKind.CHARRED)[..., 3]
    assert not opacity[:, 0].any()
    assert (opacity[:, -1] == 255).all()
    middle = opacity[:, opacity.shape[1] // 2]
    assert middle.min() < 60
    assert middle.max() > 200
