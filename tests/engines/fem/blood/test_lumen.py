"""A tube under pressure: what an opening lets out, and what clips hold back."""

from math import pi
from pathlib import Path

import numpy as np
import pytest

from engines.fem.blood.film import BLOOD
from engines.fem.blood.lumen import opening_flow
from engines.fem.params import FemParams
from engines.tissue.meshing.tet_mesh import TetMesh
from hub.participant import Inputs
from robots import rotation
from schemas.files import Files
from schemas.ros import EmptyMessage
from tests.engines.fem.rig import FemRig

MMHG = 133.322
TUBE = {
    "tube": {"length": "40 mm", "diameter": "5 mm", "wall": "1 mm"},
    "nodes": 320,
    "young_modulus": "100 kPa",
    "cutting": {"toughness": "30 J/m^2"},
    "lumen": {"pressure": "78 mmHg"},
}
FAR = np.array([[0.0, -0.05, 0.0], [0.0, 0.05, 0.0]])


def given(clip=None, **changes):
    tube = TUBE | changes
    return FemParams.model_validate(
        {
            "organs": {"block": tube},
            "probes": {"probe": {"spheres": 2, "radius": "1 mm", "clip": clip or {}}},
            "gravity": 0.0,
        },
        context=Files(Path("/")).context,
    )


class TubeRig(FemRig):
    """A tube along x, and two jaws above and below."""

    def __init__(self, clip=None, **changes):
        super().__init__(given(clip, **changes), FAR)
        self.commands = {}
        self.inputs = Inputs(
            {"probe/position": self.pose, "probe/velocity": self.twist}, events=self.commands
        )

    @property
    def organ(self):
        return self.engine._organs[0]

    @property
    def lumen(self):
        return self.engine._blood.bleedings[0].lumen

    @property
    def rate(self):
        """Flow out of the tube, m^3/s."""
        return 1e-6 * float(self.outputs["block/bleeding"][0])

    def open(self, x, above=-1.0):
        """Part the tube at x, or only what is above a height."""
        solid, mesh = self.organ.solid, self.organ.mesh
        middles = mesh.nodes[solid.origin[solid.tetrahedra]].mean(axis=1)
        right = middles[:, 0] > x
        across = solid._across
        other = np.where(across >= 0, across // 4, 0)
        chosen = (across >= 0) & (right[:, None] != right[other])
        chosen &= (0.5 * (middles[:, None] + middles[other]))[..., 2] > above
        solid.compiled.open(np.flatnonzero(chosen.ravel()).astype(np.int32))
        self.organ._note_change()

    def clip(self, x, y=0.0, gap=6e-3):
        """Put a clip on the tube at x."""
        self.at[:] = [[x, y, -0.5 * gap], [x, y, 0.5 * gap]]
        self.hold(0.002)
        self.commands["probe/clip"] = (EmptyMessage(),)
        self.hold(0.001)
        found = self.outputs["block/events"]
        self.commands.clear()
        self.at[:] = FAR
        self.hold(0.2)
        return found


def test_a_wide_opening_behind_nothing_is_an_orifice_and_a_long_tube_is_poiseuilles():
    area, rho, p = pi * (0.5e-3) ** 2, BLOOD.density, 78.0 * MMHG
    assert opening_flow(p, area, 0.0, rho) == pytest.approx(0.6 * area * np.sqrt(2.0 * p / rho), rel=1e-9)
    resistance = 8.0 * pi * BLOOD.viscosity * 10.0 / area**2
    assert opening_flow(p, 100.0 * area, resistance, rho) == pytest.approx(p / resistance, rel=1e-3)
    for shut in ((p, 0.0, 0.0), (p, area, np.inf), (0.0, area, 0.0)):
        assert opening_flow(*shut, rho) == 0.0


def test_a_parted_artery_bleeds_from_both_ends_by_its_pressure():
    with TubeRig() as rig:
        rig.hold(0.016)
        assert rig.rate == 0.0
        rig.open(0.0)
        rig.hold(0.016)
        area = float(rig.lumen.areas(rig.organ.mesh.nodes).mean())
        assert area == pytest.approx(pi * 1.5e-3**2, rel=0.15)
        resistance = 8.0 * pi * BLOOD.viscosity * 20e-3 / area**2
        expected = 2.0 * opening_flow(78.0 * MMHG, area, resistance, BLOOD.density)
        assert rig.rate == pytest.approx(expected, rel=0.05)


def test_a_hole_lets_out_its_share_and_one_end_supplies_half():
    with TubeRig(lumen={"pressure": "78 mmHg", "supply": ["left"]}) as rig:
        rig.open(0.0, above=0.5e-3)
        rig.hold(0.016)
        hole = rig.rate
        assert hole > 0.0
        rig.open(0.0)
        rig.hold(0.016)
        assert 0.2 * rig.rate < hole < 0.8 * rig.rate


def test_a_reserve_behind_the_left_end_runs_out():
    lumen = {"liquid": "bile", "pressure": "10 mmHg", "supply": ["left"], "reserve": "1 ml"}
    with TubeRig(lumen=lumen) as rig:
        rig.open(0.0)
        rig.hold(0.016)
        first = rig.rate
        rig.hold(0.1)
        assert 0.0 < rig.rate < 0.8 * first
        rig.hold(0.5)
        assert rig.rate < 1e-6 * first
        assert float(rig.outputs["block/blood/lost"][0]) == pytest.approx(1.0, rel=0.05)


def test_most_flow_bounds_an_artery():
    with TubeRig(lumen={"pressure": "78 mmHg", "most_flow": "4 ml/s"}) as rig:
        rig.open(0.0)
        rig.hold(0.016)
        assert rig.rate == pytest.approx(8e-6, rel=1e-6)


def test_between_two_clips_the_lumen_is_without_pressure():
    with TubeRig() as rig:
        (left,), (right,) = rig.clip(-6e-3), rig.clip(6e-3)
        assert (left.kind, left.instrument, left.unit) == ("clipped", "probe", "m")
        assert left.position.x == pytest.approx(-6e-3)
        assert right.kind == "clipped"
        inner = rig.lumen._rings
        ring = int(np.abs(rig.organ.mesh.nodes[inner[:, 0], 0] + 6e-3).argmin())
        height = np.ptp(rig.organ.nodes[inner[ring], 2])
        assert height < 0.5e-3  # the walls meet, where they were 3 mm apart
        rig.open(0.0)
        rig.hold(0.05)
        assert rig.rate == 0.0
        assert np.isfinite(rig.organ.nodes).all()


def test_a_second_clip_at_the_same_place_ties_nothing_more():
    with TubeRig() as rig:
        rig.clip(-6e-3)
        ties = rig.organ.solid._ties.copy()
        (event,) = rig.clip(-6e-3)
        assert event.kind == "clipped"
        assert np.array_equal(rig.organ.solid._ties, ties)


def test_one_clip_leaves_the_other_end_open():
    with TubeRig() as rig:
        rig.open(0.0)
        rig.hold(0.016)
        both = rig.rate
        rig.clip(-6e-3)
        assert rig.rate == pytest.approx(0.5 * both, rel=0.1)
        rig.clip(6e-3)
        assert rig.rate == 0.0


def foreign_tube(folder):
    """Write a tube as another program would leave it: nodes in any order; return its organ."""
    tube = FemParams.model_validate({"organs": {"block": TUBE}}).organs["block"].local
    order = np.random.default_rng(2).permutation(len(tube.nodes))
    shuffled = TetMesh(tube.nodes[order], np.argsort(order)[tube.tetrahedra])
    shuffled.write_vtk(folder / "duct.vtk")
    line = [["-20 mm", 0.0, 0.0], ["20 mm", 0.0, 0.0]]
    ends = [{"surface": "left"}, {"surface": "right"}]
    lumen = {"pressure": "78 mmHg", "line": line}
    return {"tube": None, "nodes": None, "mesh": folder / "duct.vtk", "anchors": ends, "lumen": lumen}


def test_an_imported_tube_bleeds_and_is_clipped_as_a_generated_one(tmp_path):
    with TubeRig() as known, TubeRig(**foreign_tube(tmp_path)) as rig:
        known.open(0.0)
        known.hold(0.016)
        event = rig.clip(-12e-3)[0]
        assert (event.kind, rig.lumen.shut.any()) == ("clipped", True)
        rig.open(0.0)
        rig.hold(0.016)
        assert rig.rate == pytest.approx(0.5 * known.rate, rel=0.1)
        rig.clip(12e-3)
        assert rig.rate == 0.0


def test_a_lumen_of_a_solid_mesh_is_refused(tmp_path):
    organ = foreign_tube(tmp_path)
    organ["lumen"] = organ["lumen"] | {"line": [["-20 mm", "9 mm", 0.0], ["20 mm", "9 mm", 0.0]]}
    with pytest.raises(ValueError, match="the mesh has no inner wall around the line of its lumen"):
        given(**organ)
    with pytest.raises(ValueError, match="or of a hollow mesh around the `line`"):
        given(**(organ | {"lumen": {}}))


def pull_at_clip(rig, way, most):
    """Let sphere 0 hold what is under a clip and go along `way`; return event and largest pull."""
    rig.clip(0.0)
    clips = rig.engine._blood.bleedings[0].clips
    nodes = np.unique(rig.organ.solid.ties[clips._clip_of == clips._clip_of.max()])
    rig.at[:] = FAR
    rig.hold(0.002)
    for node in nodes.tolist():
        rig.organ.anchor(node, 0)
    largest = 0.0
    for _ in range(round(most / 0.0125e-3)):
        rig.move(rig.at + 0.0125e-3 * np.array(way), 0.001)
        found = [one for one in rig.outputs["block/events"] if one.kind == "clip pulled off"]
        if found:
            return found[0], largest
        pull = rig.organ.solid.force[nodes, :3].astype(float).sum(axis=0)
        largest = max(largest, float(np.linalg.norm(pull)))
    return None, largest


@pytest.mark.parametrize(
    ("way", "limits", "expected"),
    [
        ((1.0, 0.0, 0.0), {"hold_along": "0.3 N"}, 0.3),
        ((0.0, 1.0, 0.0), {"hold_across": "0.05 N"}, 0.05),
    ],
)
def test_a_clip_that_is_pulled_too_hard_comes_off_and_the_tube_opens(way, limits, expected):
    with TubeRig(limits) as rig:
        event, largest = pull_at_clip(rig, way, 8e-3)
        assert event is not None
        assert event.size == pytest.approx(expected, rel=0.15)
        assert largest < 1.1 * expected
        assert not rig.lumen.shut.any()
        assert (rig.organ.solid.ties < 0).all()
        rig.organ.solid.let_go(0)
        rig.open(0.0)
        rig.hold(0.05)
        assert rig.rate > 0.0


def test_a_clip_that_comes_off_leaves_the_others():
    with TubeRig({"hold_across": "0.05 N"}) as rig:
        rig.clip(-12e-3)
        shut = rig.lumen.shut.copy()
        clips = rig.engine._blood.bleedings[0].clips
        before = np.sort(rig.organ.solid.ties[clips._clip_of == 0], axis=0)
        event, _ = pull_at_clip(rig, (0.0, 1.0, 0.0), 8e-3)
        assert event is not None
        assert np.array_equal(rig.lumen.shut, shut)
        assert np.array_equal(np.sort(rig.organ.solid.ties[clips._clip_of == 0], axis=0), before)


def test_a_clip_has_a_body_where_it_sits():
    with TubeRig() as rig:
        rig.hold(0.02)
        assert rig.outputs["clips"].types.size == 0
        rig.clip(5e-3)
        shown = rig.outputs["clips"]
        poses, scales = shown.poses.reshape(-1, 7), shown.scales_m.reshape(-1, 3)
        assert shown.namespaces == ["block/clips"] * 3
        assert np.abs(poses[:2, 0] - 5e-3).max() < 1.1e-3
        assert poses[0, 2] - poses[1, 2] == pytest.approx(2.7e-3, rel=0.1)  # two walls of 1 mm, two half legs
        assert scales[0] == pytest.approx([11e-3, 1.2e-3, 0.7e-3])
        legs = [rotation.matrix(pose[3:]) for pose in poses[:2]]
        assert np.abs(legs[0][:, 0]) == pytest.approx([0.0, 1.0, 0.0], abs=0.1)
        assert np.abs(legs[0][:, 1]) == pytest.approx([1.0, 0.0, 0.0], abs=0.1)


@pytest.mark.parametrize(
    ("changes", "clip", "y", "reason"),
    [
        ({}, {"diameters": ["6 mm", "9 mm"]}, 0.0, "too little"),
        ({}, {"diameters": ["2 mm", "4 mm"]}, 0.0, "too much"),
        ({}, {"length": "6 mm"}, 0.0, "too much"),
        ({}, {}, 6e-3, "not between the jaws"),
    ],
)
def test_a_clip_that_does_not_fit_slips_and_says_why(changes, clip, y, reason, monkeypatch):
    said = []
    monkeypatch.setattr("engines.fem.blood.clip.warn_once", said.append)
    with TubeRig(clip, **changes) as rig:
        (event,) = rig.clip(0.0, y)
        assert event.kind == "clip slipped"
        assert reason in said[0]
        assert not rig.lumen.shut.any()
        assert (rig.organ.solid._ties < 0).all()


def test_a_clipped_and_bleeding_tube_is_saved_and_restored_to_the_bit():
    with TubeRig() as rig, TubeRig() as other:
        rig.clip(-6e-3)
        rig.open(0.0)
        rig.hold(0.021)
        saved = rig.engine.save()
        other.engine.restore(saved)
        other.t, other.at[...] = rig.t, rig.at
        for each in (rig, other):
            each.hold(0.05)
        assert rig.hashes[-50:] == other.hashes
        assert rig.engine.save() == other.engine.save()


def test_bile_is_bile():
    with TubeRig(lumen={"liquid": "bile", "pressure": "10 mmHg"}) as rig:
        rig.open(0.0)
        rig.hold(0.032)
        assert rig.outputs["block/film"].liquid == "bile"
        assert rig.outputs["block/film"].nodes.size
