"""A sphere on an organ that sways: the spring in series does not chatter."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.engines.fem.rig import FemRig, params

TRUTH = json.loads((Path(__file__).parents[3] / "bench" / "tissue_truth.json").read_text())["liver"]
RADIUS = 5e-3


def test_the_force_on_a_loose_lobe_of_a_coarse_liver_is_steady_and_right():
    organ = {"shape": "liver-lobe", "nodes": 250}
    with FemRig(params(organ, {"radius": RADIUS}), start=(0.0, 0.0, 0.5)) as rig:
        nodes, faces = rig.nodes, rig.engine._organs[0].touchable
        corners = nodes[faces]
        near = np.linalg.norm(corners.mean(axis=1) - np.array(TRUTH["point_m"]), axis=1).argmin()
        at = corners[near].mean(axis=0)
        a, b, c = corners[np.linalg.norm(corners.mean(axis=1) - at, axis=1) < 8e-3].transpose(1, 0, 2)
        inward = -np.cross(b - a, c - a).sum(axis=0)
        inward /= np.linalg.norm(inward)
        rig.at[...] = at - (RADIUS + 1e-3) * inward
        rig.move(at + (2e-3 - RADIUS) * inward, 0.1)
        rig.hold(0.3)
        felt = -rig.hold(0.2)[:, :3] @ inward
        assert felt.std() < 0.1 * felt.mean()
        assert felt.mean() == pytest.approx(TRUTH["force_n"]["5"][1], rel=0.15)
