"""Burns painted on the outside of an organ."""

from __future__ import annotations

import numpy as np

from engines.mujoco.textures.atlas import Atlas
from engines.mujoco.textures.burns import Burns
from engines.mujoco.textures.noise import Noise
from engines.mujoco.textures.tissues import TISSUES
from tests.engines.tissue.cut_block import CutBlock

PIXELS = 256


def test_a_burn_has_a_ragged_edge_and_leaves_the_rest() -> None:
    block = CutBlock(np.array([0.06, 0.04, 0.01]), 250)
    rest, noise = block.mesh.nodes, Noise(3)
    atlas = Atlas(rest, block.mesh.triangles.astype(np.int64), PIXELS)
    outside = atlas.paint(TISSUES["liver"], noise)
    x = atlas.interpolate(rest[:, 0]).reshape(PIXELS, PIXELS)
    share = np.clip((rest[:, 0] + 0.004) / 0.008, 0.0, 1.0)
    maps = Burns(atlas, outside, noise).maps(share, share)
    left, right = x < -0.015, x > 0.015
    assert np.array_equal(maps.colour[left], outside.colour[left])
    assert maps.colour[right].mean() < 0.5 * outside.colour[right].mean()  # black
    assert maps.orm[right, 1].mean() > 2.0 * outside.orm[right, 1].mean()  # dry
    black = maps.colour.max(axis=2) < 50
    at_edge = np.abs(x) < 0.003
    assert 0.1 < black[at_edge].mean() < 0.9
