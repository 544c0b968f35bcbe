"""A tube under pressure: what an opening lets out, and what clips hold back."""

from math import pi

import numpy as np
import pytest

from engines.fem.blood.film import BLOOD
from engines.fem.blood.lumen import opening_flow
from engines.fem.params import FemParams
from hub.participant import Inputs
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
        }
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
