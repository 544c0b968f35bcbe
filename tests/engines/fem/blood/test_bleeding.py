"""Tissue that is cut bleeds by its area and perfusion, until it is coagulated, clotted, or without supply."""

import numpy as np
import pytest
from hypothesis import given as over
from hypothesis import strategies as st

from engines.bullet.params import BulletParams
from engines.fem.blood.film import QUANTUM
from engines.fem.engine import FemEngine
from engines.fem.params import FemParams
from hub.participant import Inputs
from hub.testing import check_engine
from schemas.codec import encode
from schemas.soft_surface import FaceKind, film_steps
from tests.engines.fem.rig import FemRig

BLOCK = {
    "size": ["30 mm", "20 mm", "10 mm"],
    "nodes": 250,
    "young_modulus": "50 kPa",
    "density": "1000 kg/m^3",
    "cutting": {"toughness": "30 J/m^2"},
    "bleeding": {"perfusion": "600 ml/min/kg", "depth": "10 mm"},
}
FLUX = 600.0e-6 / 60.0 * 1000.0 * 10e-3
"""Perfusion times density times depth, m/s."""
SCALPEL = {"spheres": 2, "radius": "1 mm", "blades": [[0, 1]]}
START = np.array([[-0.017, 0.0013, 0.002], [-0.017, 0.0013, -0.005]])
FAR = np.array([[0.0, 0.0, 0.1], [0.0, 0.0, 0.11]])


def given(block=None, probe=None):
    return {"organs": {"block": block or BLOCK}, "probes": {"probe": probe or SCALPEL}}


class BloodRig(FemRig):
    """`FemRig` with a scalpel far away, and faces that open at once."""

    def __init__(self, start=FAR, **changes):
        block = BLOCK | {"bleeding": BLOCK["bleeding"] | changes.pop("bleeding", {})} | changes
        self.events = []
        super().__init__(FemParams.model_validate(given(block)), start)

    @property
    def bleeding(self):
        return self.engine._blood.bleedings[0]

    @property
    def organ(self):
        return self.engine._organs[0]

    def follow(self, motion, seconds):
        steps = round(seconds * 1e9 / self.period)
        for i in range(steps):
            super().follow(lambda t, i=i: motion(t + i * 1e-9 * self.period), 1e-9 * self.period)
            self.events += self.outputs["block/events"]

    def open(self, height=-2e-3):
        """Open the faces between elements above and below a height."""
        solid = self.organ.solid
        above = self.organ.mesh.nodes[solid.origin[solid.tetrahedra]].mean(axis=1)[:, 2] > height
        across = solid._across
        inner = across >= 0
        other = np.where(inner, across // 4, 0)
        faces = np.flatnonzero((inner & (above[:, None] != above[other])).ravel())
        solid.compiled.open(faces.astype(np.int32))
        self.organ._note_change()

    @property
    def rate(self):
        return float(self.outputs["block/bleeding"][0])

    @property
    def volumes(self):
        found = self.bleeding.volumes
        assert self.outputs["block/blood/lost"][0] == found[0]
        assert self.outputs["block/blood/surface"][0] == found[1]
        return found


def area_of(rig, kinds=(FaceKind.CUT,)):
    faces = rig.organ.surface.faces[np.isin(rig.organ.surface.kinds, kinds)]
    a, b, c = (rig.organ.nodes[faces[:, i]] for i in range(3))
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def test_a_cut_bleeds_by_its_area_and_perfusion():
    with BloodRig(START) as rig:
        rig.move(START + np.array([0.04, 0.0, 0.0]), 0.5)
        area = area_of(rig)
        assert area > 1.5 * 0.03 * 5e-3
        assert rig.rate == pytest.approx(1e6 * FLUX * area, rel=1e-9)
        before = rig.volumes.copy()
        rig.hold(0.4)
        assert rig.volumes[0] - before[0] == pytest.approx(0.4 * rig.rate, rel=1e-6)
        assert rig.volumes[0] == pytest.approx(rig.volumes[1:].sum(), rel=1e-12)
        assert rig.bleeding.imbalance == 0


@pytest.mark.long
@over(st.integers(0, 2**32 - 1))
def test_no_blood_is_lost_on_a_mesh_that_is_opened_and_taken_away(seed):
    random = np.random.default_rng(seed)
    with BloodRig(nodes=100, bleeding={"perfusion": "6000 ml/min/kg"}) as rig:
        solid = rig.organ.solid
        count = len(rig.organ.mesh.tetrahedra)
        for _ in range(6):
            solid.compiled.open(random.integers(0, 4 * count, 20, np.int32))
            rig.organ._note_change()
            rig.organ.remove(random.integers(0, count, 3))
            rig.hold(0.02)
            assert rig.bleeding.imbalance == 0
            assert rig.bleeding.film.amounts.min() >= 0
            assert len(rig.bleeding.film.amounts) == len(rig.organ.nodes)
        assert rig.volumes[0] > 0.0
        assert rig.volumes[0] == pytest.approx(rig.volumes[1:].sum(), rel=1e-12)


def test_an_uncut_organ_is_dry():
    with BloodRig() as rig:
        rig.hold(0.05)
        assert rig.rate == 0.0
        assert not rig.volumes.any()
        assert rig.outputs["block/film"].nodes.size == 0


@pytest.mark.long
def test_blood_runs_over_the_surface_and_drips_off_the_lower_edge():
    with BloodRig() as rig:
        rig.open()
        rig.hold(0.3)
        film = rig.outputs["block/film"]
        steps = film_steps(film, len(rig.nodes))
        assert steps.max() > 0
        rig.bleeding.film.amounts[rig.organ.surface.present[0]] += int(2e-6 / QUANTUM)
        rig.bleeding._book[0] += 3 * int(2e-6 / QUANTUM)
        rig.hold(1.0)
        assert rig.volumes[2] > 1.0
        assert rig.bleeding.imbalance == 0
        wet = film_steps(rig.outputs["block/film"], len(rig.nodes)) > 0
        assert (rig.nodes[wet, 2] < -8e-3).any()


def test_a_piece_without_a_tie_to_an_anchor_does_not_bleed():
    with BloodRig() as rig:
        rig.open()
        rig.hold(0.02)
        assert rig.rate == pytest.approx(0.5e6 * FLUX * area_of(rig), rel=0.2)  # the lower side alone
        (began,) = [event for event in rig.events if event.kind == "bleeding"]
        assert (began.instrument, began.unit) == ("", "ml/s")
        assert began.size == pytest.approx(rig.rate, rel=0.01)
        assert began.position.z == pytest.approx(-2e-3, abs=2e-3)


def test_coagulated_tissue_does_not_bleed():
    with BloodRig() as rig:
        rig.open()
        rig.hold(0.02)
        before = rig.rate
        surface = rig.organ.surface
        cut = np.flatnonzero(surface.kinds == FaceKind.CUT)
        half = cut[rig.nodes[surface.faces[cut]].mean(axis=1)[:, 0] < 0.0]
        surface.replace(half, surface.faces[half], np.full(len(half), FaceKind.COAGULATED))
        rig.hold(0.02)
        assert rig.rate == pytest.approx(0.5 * before, rel=0.2)
        surface.replace(cut, surface.faces[cut], np.full(len(cut), FaceKind.CHARRED))
        rig.events.clear()
        rig.hold(0.02)
        assert rig.rate == 0.0
        (stopped,) = rig.events
        assert (stopped.kind, stopped.unit) == ("bleeding stopped", "ml")
        assert stopped.size == pytest.approx(rig.volumes[0])


def test_a_cut_clots_with_time():
    with BloodRig(bleeding={"clotting": "0.4 s"}) as rig:
        rig.open()
        rig.hold(0.016)
        first = rig.rate
        rig.hold(0.2)
        assert rig.rate == pytest.approx(0.5 * first, rel=0.1)
        rig.hold(0.3)
        assert rig.rate == 0.0
        assert rig.volumes[0] == pytest.approx(0.5 * 0.4 * first, rel=0.1)


def test_a_bleeding_organ_is_saved_and_restored_to_the_bit():
    with BloodRig(START) as rig, BloodRig(START) as other:
        rig.move(START + np.array([0.02, 0.0, 0.0]), 0.303)
        saved, at = rig.engine.save(), rig.at.copy()
        other.engine.restore(saved)
        other.t, other.at[...] = rig.t, at
        assert other.engine.save() == saved
        for each in (rig, other):
            each.move(at + np.array([0.01, 0.0, 0.0]), 0.1)
        assert rig.hashes[-100:] == other.hashes
        assert rig.engine.save() == other.engine.save()
        assert np.array_equal(rig.volumes, other.volumes)
        films = [each.outputs["block/film"] for each in (rig, other)]
        assert encode(films[0]) == encode(films[1])


def test_suction_takes_up_what_is_in_reach():
    sucker = {"radius": "1 mm", "suction": {"rate": "0.1 ml/s", "reach": "50 mm"}}
    with FemRig(FemParams.model_validate(given(probe=sucker)), (0.0, 0.0, 0.02)) as rig:
        command = np.zeros(1)
        rig.inputs = Inputs({"probe/pose": rig.pose, "probe/twist": rig.twist, "probe/suction": command})
        bleeding = rig.engine._blood.bleedings[0]
        top = np.flatnonzero(bleeding.organ.nodes[:, 2] > -1e-3)
        bleeding.film.amounts[top] = int(0.06e-6 / QUANTUM / len(top))
        bleeding._book[0] = bleeding.on_surface
        rig.hold(0.1)
        assert rig.outputs["probe/sucked"][0] == 0.0
        command[0] = np.nan
        rig.hold(0.02)
        assert rig.outputs["probe/sucked"][0] == 0.0
        command[0] = 0.5
        rig.hold(0.4)
        assert rig.outputs["probe/sucked"][0] == pytest.approx(0.02, rel=0.05)
        command[0] = 7.0
        rig.hold(1.0)
        total = bleeding.volumes
        assert rig.outputs["probe/sucked"][0] == pytest.approx(total[3], rel=1e-9)
        assert total[0] == pytest.approx(total[1:].sum(), rel=1e-12)
        assert total[1] < 0.02 * total[0]


def test_the_engine_keeps_its_contract():
    sucker = SCALPEL | {"suction": {}}
    check_engine(
        lambda: FemEngine("tissue", FemParams.model_validate(given(probe=sucker))),
        inputs={"probe/suction": [1.0], "probe/velocity": [0.1, 0.0, 0.0] * 2},
    )


def test_bleeding_needs_cutting_and_kind_fem():
    uncut = {key: value for key, value in BLOCK.items() if key != "cutting"}
    with pytest.raises(ValueError, match="bleeding goes with `cutting`"):
        FemParams.model_validate(given(uncut))
    with pytest.raises(ValueError, match="suction finds no blood"):
        FemParams.model_validate(given({**uncut, "bleeding": None}, SCALPEL | {"suction": {}}))
    with pytest.raises(ValueError, match="leave it out here"):
        BulletParams.model_validate(
            {
                "organs": {"block": {"size": [0.1, 0.1, 0.1], "young_modulus": 1e4}},
                "probes": {"probe": {"suction": {}}},
            }
        )


def test_heat_seals_a_cut():
    block = BLOCK | {"size": ["12 mm", "8 mm", "4 mm"], "nodes": 250}
    probe = {"radius": "2 mm", "energy": {"power": "60 W"}}
    with FemRig(FemParams.model_validate(given(block, probe)), (0.0, 0.0, 1.7e-3)) as rig:
        organ, watts = rig.engine._organs[0], np.zeros(1)
        rig.inputs = Inputs({"probe/pose": rig.pose, "probe/twist": rig.twist, "probe/energy": watts})
        middles = organ.mesh.nodes[organ.solid.tetrahedra].mean(axis=1)
        across = organ.solid._across
        other = np.where(across >= 0, across // 4, 0)
        left = middles[:, 0] < 0.0
        opened = (across >= 0) & (left[:, None] != left[other])
        organ.solid.compiled.open(np.flatnonzero(opened.ravel()).astype(np.int32))
        organ._note_change()
        rig.hold(0.02)
        before = rig.outputs["block/bleeding"][0]
        assert before > 0.0
        watts[0] = 60.0
        rig.hold(0.8)
        assert rig.outputs["block/hottest"][0] > 90.0
        assert rig.outputs["block/bleeding"][0] < 0.9 * before
