"""Tubes in jaws: closing jaws flatten a tube, a clip keeps it flat, a held duct is pulled steadily."""

import numpy as np
import pytest

from engines.fem.params import FemParams
from hub.participant import Inputs
from schemas.ros import EmptyMessage
from tests.engines.fem.blood.test_lumen import TUBE, TubeRig
from tests.engines.fem.rig import FemRig

SPHERES = 5
"""In each jaw."""


def jaws(half_gap, x=0.0):
    """Return the spheres of two jaws across a tube along x, m."""
    across = np.linspace(-4e-3, 4e-3, SPHERES)
    rows = [
        np.column_stack([np.full(SPHERES, x), across, np.full(SPHERES, z)]) for z in (-half_gap, half_gap)
    ]
    return np.concatenate(rows)


class JawRig(TubeRig):
    """A tube along x between two jaws."""

    def __init__(self, modulus, inertia=1.0):
        tube = TUBE | {"young_modulus": modulus, "inertia": inertia}
        probe = {"spheres": 2 * SPHERES, "radius": "1 mm", "clip": {}}
        given = {"organs": {"block": tube}, "probes": {"probe": probe}, "gravity": 0.0}
        FemRig.__init__(self, FemParams.model_validate(given), jaws(4.5e-3))
        self.commands = {}
        pose = {"probe/position": self.pose, "probe/velocity": self.twist}
        self.inputs = Inputs(pose, events=self.commands)

    @property
    def opening(self):
        """Cross-section in the middle over that at rest."""
        areas = self.lumen.areas(self.organ.nodes) / self.lumen.areas(self.organ.mesh.nodes)
        return float(areas[len(areas) // 2])

    def squeeze(self, half_gap):
        """Close the jaws; return mean and deviation of the force on both along z, N, shape (2, 2)."""
        self.move(jaws(half_gap), 0.1)
        self.hold(0.05)
        forces = self.hold(0.05).reshape(-1, 2, SPHERES, 3)[..., 2].sum(axis=2)
        return np.stack([forces.mean(axis=0), forces.std(axis=0)])


@pytest.mark.long
def test_closing_jaws_flatten_a_tube_with_equal_forces_by_its_modulus():
    found = {}
    for modulus, inertia in (("100 kPa", 1.0), ("300 kPa", 25.0)):
        with JawRig(modulus, inertia) as rig:
            (below, above), deviations = rig.squeeze(1.8e-3)
            assert rig.opening < 0.2
            assert above == pytest.approx(-below, rel=0.02)
            assert deviations.max() < 0.01 * above
            found[modulus] = above
            rig.squeeze(4.5e-3)
            assert rig.opening > 0.95
    assert found["300 kPa"] == pytest.approx(3.0 * found["100 kPa"], rel=0.08)


def test_a_clip_keeps_a_flattened_tube_shut_when_the_jaws_open():
    with JawRig("300 kPa", 25.0) as rig:
        rig.squeeze(1.8e-3)
        rig.commands["probe/clip"] = (EmptyMessage(),)
        rig.hold(0.001)
        assert [event.kind for event in rig.outputs["block/tube"]] == ["clipped"]
        rig.commands.clear()
        rig.hold(0.2)
        rig.squeeze(4.5e-3)
        line = rig.outputs["block/line"]
        shut = np.flatnonzero(line.shut)
        assert shut.size
        assert rig.opening < 0.1
        assert line.areas_m2[shut[0] - 4] > 0.9 * line.areas_m2[0]


@pytest.mark.long
def test_a_duct_that_is_held_and_pulled_is_borne_by_its_joints_without_chatter():
    far = np.array([[0.0, -0.2, 0.2], [0.0, -0.2, 0.21]])
    probes = {"probe": {"spheres": 2, "radius": "1 mm"}}
    given = {"anatomy": {"patient": 7, "phase": "clip-and-cut"}, "probes": probes, "own_sub_steps": True}
    with FemRig(FemParams.model_validate(given), far) as rig:
        organs = {organ.name: organ for organ in rig.engine._organs}
        middles = rig.outputs["cystic_duct/line"].points_m.reshape(-1, 3)
        middle, duct = middles[len(middles) // 2], organs["cystic_duct"]
        for organ in organs.values():
            for sphere in (0, 1):
                organ.let_touch(sphere, on=False)
        rig.at[:] = middle + np.array([[0.0, 0.0, 0.01], [0.0, 0.0, 0.02]])
        rig.hold(0.002)
        for node in np.flatnonzero(np.linalg.norm(duct.nodes - middle, axis=1) < 3.2e-3).tolist():
            duct.anchor(node, 0)
        rig.move(rig.at + np.array([0.0, 0.0, 6e-3]), 0.15)
        rig.hold(0.05)
        felt = rig.hold(0.03)[:, :3]
        assert felt[:, 2].mean() < -0.2
        assert np.linalg.norm(felt.std(axis=0)) < 0.03 * np.linalg.norm(felt.mean(axis=0))
        assert np.linalg.norm(rig.outputs["duct_confluence/force"]) > 0.1
        assert rig.outputs["duct_confluence/freed"][0] == rig.outputs["neck_duct/freed"][0] == 0.0
