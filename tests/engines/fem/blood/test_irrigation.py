"""Saline on tissue: apart from blood to the last part, thinner than blood, in the book until it is gone."""

import numpy as np
import pytest
from hypothesis import given as over
from hypothesis import strategies as st

from engines.fem.blood.film import BLOOD, QUANTUM, SALINE, Film
from engines.fem.engine import FemEngine
from engines.fem.params import FemParams
from engines.tissue.meshing.grid import block
from hub.participant import Inputs
from hub.testing import check_engine
from robots import rotation
from tests.engines.fem.blood.test_bleeding import SCALPEL, given
from tests.engines.fem.blood.test_film import GRAVITY, STEP, plane, tilted
from tests.engines.fem.rig import FemRig


@over(st.integers(0, 2**32 - 1))
def test_blood_and_saline_are_only_ever_moved(seed):
    random = np.random.default_rng(seed)
    mesh = block(np.array([0.03, 0.02, 0.01]), 120)
    turn = random.standard_normal(4)
    places = np.ascontiguousarray(mesh.nodes @ rotation.matrix(turn / np.linalg.norm(turn)).T)
    faces = mesh.triangles.astype(np.int32)
    film = Film(BLOOD, len(places), GRAVITY)
    film.may_be_irrigated()
    film.amounts[:] = random.integers(0, 10 ** random.integers(1, 13, len(places)))
    blood, saline = int(film.amounts.sum()), 0
    for _ in range(60):
        nodes = random.permutation(len(places))[:7]
        film.irrigate(nodes, rinse := int(random.integers(0, 10**11)))
        saline += rinse
        before = int(film.saline.sum())
        gone = film.run(faces, places, STEP) + film.take(random.permutation(len(places))[:10], 10**9)
        left = before - int(film.saline.sum())
        blood, saline = blood - (gone - left), saline - left
        assert ((film.saline >= 0) & (film.saline <= film.amounts)).all()
        assert (int((film.amounts - film.saline).sum()), int(film.saline.sum())) == (blood, saline)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_diluted_blood_runs_down_a_plane_as_thick_as_a_liquid_of_the_mean_fluidity(share):
    size, rows, flow = 2e-3, 30, 2e-7
    flat, faces = plane(9, rows, size)
    places = tilted(flat, np.radians(60.0))
    film = Film(BLOOD, len(places), GRAVITY)
    film.may_be_irrigated()
    row = np.rint(flat[:, 1] / size).astype(int)
    inside = (flat[:, 0] > 0.0) & (flat[:, 0] < 8 * size - 1e-9)
    for _ in range(3000):
        width = np.where(inside, size, 0.5 * size)
        fresh = (flow * STEP * width / QUANTUM).astype(np.int64)[row == rows - 1]
        film.amounts[row == rows - 1] += fresh
        film.saline[row == rows - 1] += (share * fresh).astype(np.int64)
        film.run(faces, places, STEP)
        film.amounts[row == 0] = film.saline[row == 0] = 0
    middle = inside & (row > 5) & (row < rows - 5)
    assert film.saline[middle] / film.amounts[middle] == pytest.approx(share, abs=1e-4)
    thickness = QUANTUM * film.amounts[middle] / size**2
    mobility = (1.0 - share) * BLOOD.density / BLOOD.viscosity + share * SALINE.density / SALINE.viscosity
    nusselt = (3.0 * flow / (mobility * GRAVITY * np.sin(np.radians(60.0)))) ** (1.0 / 3.0)
    assert thickness == pytest.approx(nusselt, rel=1e-3)


def test_a_picture_shows_the_blood_in_the_film_and_no_saline():
    places, faces = plane(6, 6, 2e-3)
    film = Film(BLOOD, len(places), GRAVITY)
    film.may_be_irrigated()
    film.amounts[:18] = int(4e-10 / QUANTUM)
    before = film.thickness(faces, places, 10e-6)
    film.irrigate(np.arange(36), 36 * int(8e-10 / QUANTUM))
    after = film.thickness(faces, places, 10e-6)
    assert (after[:18] == before[:18]).all()
    assert (after[18:] == 0).all()
    film.take(np.arange(36), int(film.amounts.sum()) // 2)
    assert after[7] / film.thickness(faces, places, 10e-6)[7] == pytest.approx(2.0, rel=0.1)


IRRIGATOR = {
    "radius": "1 mm",
    "suction": {"rate": "2 ml/s", "reach": "50 mm"},
    "irrigation": {"rate": "0.2 ml/s", "reach": "8 mm"},
}


class Rinse(FemRig):
    """An irrigator over a block with some blood on top."""

    def __init__(self, height=0.006):
        super().__init__(FemParams.model_validate(given(probe=IRRIGATOR)), (0.0, 0.0, height))
        self.sucks, self.rinses = np.zeros(1), np.zeros(1)
        self.inputs = Inputs(
            {
                "probe/pose": self.pose,
                "probe/twist": self.twist,
                "probe/suction": self.sucks,
                "probe/irrigation": self.rinses,
            }
        )
        self.bleeding = self.engine._blood.bleedings[0]
        top = np.flatnonzero(self.bleeding.organ.nodes[:, 2] > -1e-3)
        self.bleeding.film.amounts[top] = int(0.02e-6 / QUANTUM / len(top))
        self.bleeding._book[0] = self.bleeding.on_surface

    def output(self, name):
        return float(self.outputs[name][0])


def test_saline_comes_by_its_rate_and_every_part_of_it_is_in_the_book():
    with Rinse() as rig:
        rig.hold(0.1)
        assert rig.output("probe/irrigated") == 0.0
        rig.rinses[0] = 0.5
        rig.hold(1.0)
        assert rig.output("probe/irrigated") == pytest.approx(0.1, rel=0.05)
        assert rig.output("block/saline/given") == pytest.approx(rig.output("probe/irrigated"), rel=1e-12)
        rig.rinses[0] = np.nan
        rig.sucks[0] = 1.0
        rig.hold(0.4)
        given_, left, dripped, sucked = (
            rig.output(f"block/saline/{name}") for name in ("given", "surface", "dripped", "sucked")
        )
        assert given_ == pytest.approx(left + dripped + sucked, rel=1e-12)
        assert sucked > 0.02
        assert rig.bleeding.imbalance == rig.bleeding.saline_imbalance == 0
        blood = rig.bleeding.volumes
        assert rig.output("probe/sucked") == pytest.approx(sucked + blood[3], rel=1e-9)


def test_saline_falls_past_tissue_that_is_out_of_reach():
    with Rinse(height=0.05) as rig:
        rig.rinses[0] = 1.0
        rig.hold(0.2)
        assert rig.output("probe/irrigated") > 0.03
        assert rig.output("block/saline/given") == 0.0


def test_a_saved_state_goes_on_with_saline_to_the_bit():
    with Rinse() as rig, Rinse() as other:
        rig.rinses[0] = other.rinses[0] = 1.0
        rig.hold(0.1)
        other.engine.restore(rig.engine.save())
        other.t = rig.t
        for each in (rig, other):
            each.hold(0.1)
        assert rig.hashes[-50:] == other.hashes[-50:]
        assert np.array_equal(rig.bleeding.saline, other.bleeding.saline)


def test_the_engine_keeps_its_contract():
    washing = SCALPEL | {"suction": {}, "irrigation": {}}
    check_engine(
        lambda: FemEngine("tissue", FemParams.model_validate(given(probe=washing))),
        inputs={"probe/irrigation": [1.0], "probe/velocity": [0.1, 0.0, 0.0] * 2},
    )


def test_irrigation_is_for_tissue_that_bleeds():
    dry = {"size": ["30 mm", "20 mm", "10 mm"], "nodes": 250, "young_modulus": "50 kPa"}
    with pytest.raises(ValueError, match="irrigation finds no blood"):
        FemParams.model_validate(given(dry, {"irrigation": {}}))
