"""A sac of liquid: a hole lets out what is in it, and no more."""

import numpy as np
import pytest

from engines.fem.blood.film import BILE
from engines.fem.blood.lumen import opening_flow
from tests.engines.fem.blood.test_lumen import MMHG, TubeRig

SAC = {"liquid": "bile", "pressure": "10 mmHg", "volume": "0.5 ml"}


def holed(rig):
    """Open the wall above, without moving it; return the events of the step after."""
    rig.open(2e-3, above=0.5e-3)
    rig.organ.events.add("cut", np.ones(1), np.zeros((1, 3)), np.zeros(1, np.int64))
    for _ in range(20):
        rig.hold(0.001)
        if rig.outputs["block/tube"]:
            return rig.outputs["block/tube"], rig.outputs["block/events"]
    return (), ()


@pytest.mark.long
def test_a_hole_empties_a_sac_as_torricelli_says():
    with TubeRig(lumen=SAC) as rig:
        tube, _ = holed(rig)
        (opening,) = rig.lumen.openings
        area = rig.lumen.gape(opening, rig.organ.nodes)
        assert 0.0 < area < 3e-6
        whole, begun = 0.5, float(rig.outputs["block/spilled"][0])
        first = 1e6 * opening_flow(10.0 * MMHG, area, 0.0, BILE.density)
        time = 2.0 * whole / first
        assert tube
        found, start = [], rig.t * 1e-9
        for _ in range(4):
            rig.hold(0.25 * time)
            found.append(float(rig.outputs["block/spilled"][0]))
        passed = np.arange(1, 5) * 0.25
        assert found == pytest.approx(whole * (1.0 - (1.0 - passed) ** 2), rel=0.05, abs=0.05 * begun + 0.01)
        rig.hold(0.3 * time)
        assert rig.outputs["block/spilled"][0] <= whole * (1.0 + 1e-9)
        assert rig.outputs["block/spilled"][0] == pytest.approx(whole, rel=2e-3)
        assert rig.outputs["block/blood/lost"][0] == pytest.approx(rig.outputs["block/spilled"][0], rel=1e-3)
        assert start > 0.0


def test_a_perforation_is_said_once_with_its_instrument_and_cause():
    with TubeRig(lumen=SAC) as rig:
        tube, tissue = holed(rig)
        (event,) = [one for one in tube if one.kind == "perforated"]
        assert (event.instrument, event.cause, event.body) == ("probe", "cut", "block")
        assert event.along_m == pytest.approx(22e-3, abs=1.6e-3)
        assert event.position.z > 1e-3
        (same,) = [one for one in tissue if one.kind == "perforated"]
        assert (same.instrument, same.unit) == ("probe", "m^2")
        for _ in range(20):
            rig.hold(0.001)
            assert rig.outputs["block/tube"] == ()


def test_tissue_that_is_burnt_out_of_the_wall_is_a_hole():
    with TubeRig(lumen=SAC) as rig:
        solid, mesh = rig.organ.solid, rig.organ.mesh
        middles = mesh.nodes[solid.tetrahedra].mean(axis=1)
        gone = np.flatnonzero(
            (np.abs(middles[:, 0]) < 2.2e-3) & (middles[:, 2] > 1.0e-3) & (solid.volumes > 0)
        )
        rig.organ.remove(gone)
        found = []
        for _ in range(20):
            rig.hold(0.001)
            found += rig.outputs["block/tube"]
        assert [one.kind for one in found] == ["perforated"]
        assert rig.outputs["block/spilled"][0] > 0.0
        assert not rig.outputs["block/line"].parted.any()


def test_a_sac_is_saved_and_restored_while_it_runs_out():
    with TubeRig(lumen=SAC) as rig, TubeRig(lumen=SAC) as other:
        holed(rig)
        other.engine.restore(rig.engine.save())
        other.t, other.at[...] = rig.t, rig.at
        for each in (rig, other):
            each.hold(0.05)
        assert rig.hashes[-50:] == other.hashes[-50:]
        assert rig.outputs["block/spilled"] == other.outputs["block/spilled"]
