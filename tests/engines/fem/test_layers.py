"""Blocks with layers: meshes, materials, heat, and what is freed."""

import numpy as np
import pytest

from engines.bullet.params import BulletParams
from engines.fem.engine import FemEngine
from engines.fem.params import FemParams
from engines.tissue.meshing.tet_mesh import volumes
from engines.tissue.organs.materials import preset
from hub.testing import check_engine
from tests.engines.fem.rig import MS, FemRig, params

FLAP = {
    "size": ["12 mm", "8 mm", "6 mm"],
    "material": "liver",
    "layers": [
        {"name": "sheet", "thickness": "1.5 mm", "material": "fat", "young_modulus": "20 kPa"},
        {"name": "areolar", "thickness": "1.5 mm", "material": "fat"},
    ],
    "nodes": 300,
    "cutting": {},
}
HOOK = {"radius": "0.8 mm", "energy": {"power": "100 W", "efficiency": 1.0}}
IN_FRONT = (-6.7e-3, 0.0, -2.2e-3)


class FlapRig(FemRig):
    """`FemRig` with a layered block and a command of power."""

    def __init__(self, watts=0.0):
        super().__init__(params(FLAP, HOOK), start=IN_FRONT)
        self.inputs = type(self.inputs)(
            {"probe/pose": self.pose, "probe/twist": self.twist, "probe/energy": np.array([watts])}
        )

    @property
    def organ(self):
        return self.engine._organs[0]

    def number(self, port):
        return float(self.outputs[port][0])


def organ_params(**changes):
    return params(FLAP | changes).organs["block"]


def test_layers_have_whole_rows_of_cells_and_their_volumes():
    organ = organ_params()
    heights = np.unique(np.round(organ.local.nodes[:, 2], 9))
    assert {-3e-3, -1.5e-3, 0.0, -6e-3} <= set(heights.tolist())
    numbers = organ.layer_numbers(organ.local.tetrahedra)
    found = np.bincount(numbers, volumes(organ.local.nodes, organ.local.tetrahedra))
    assert found == pytest.approx(96e-6 * np.array([1.5e-3, 1.5e-3, 3e-3]))


def test_stated_rows_are_fine_and_the_tissue_below_is_coarser_from_row_to_row():
    layers = [FLAP["layers"][0] | {"rows": 3}, FLAP["layers"][1] | {"thickness": "0.5 mm", "rows": 1}]
    organ = organ_params(layers=layers, nodes=600)
    heights = np.unique(np.round(organ.local.nodes[:, 2], 9))[::-1]
    rows = -np.diff(heights)
    assert rows[:4] == pytest.approx([0.5e-3] * 4)
    assert rows[4:].sum() == pytest.approx(4e-3)
    assert rows[5:] / rows[4:-1] == pytest.approx(1.5, rel=1e-4)
    assert 0.6 < rows[4] / 0.75e-3 < 1.5
    assert len(organ.local.nodes) == pytest.approx(600, rel=0.25)
    numbers = organ.layer_numbers(organ.local.tetrahedra)
    found = np.bincount(numbers, volumes(organ.local.nodes, organ.local.tetrahedra))
    assert found == pytest.approx(96e-6 * np.array([1.5e-3, 0.5e-3, 4e-3]))


def test_every_layer_has_the_mass_and_the_stiffness_of_its_material():
    with FlapRig() as rig:
        solid, layers = rig.organ.solid, rig.organ.layers
        fat, liver = preset("fat"), preset("liver")
        weight = 96e-6 * (3e-3 * fat.density + 3e-3 * liver.density)
        assert float(solid.mass.sum(dtype=np.float64)) == pytest.approx(weight, rel=1e-5)
        shear = [np.unique(solid._shear[layers == i]) for i in range(3)]
        assert [one.size for one in shear] == [1, 1, 1]
        assert shear[0] / shear[1] == pytest.approx(20e3 / fat.young_modulus)
        assert shear[2] / shear[1] == pytest.approx(liver.young_modulus / fat.young_modulus)


def test_layers_of_one_material_are_a_block_without_layers_to_the_bit():
    alike = [{"name": "upper", "thickness": "3 mm", "material": "liver"}]
    hashes = []
    for layers in ([], alike):
        flap = FLAP | {"size": ["12 mm", "12 mm", "6 mm"], "nodes": 75, "layers": layers}
        with FemRig(params(flap), start=(0.0, 0.0, 5.2e-3)) as rig:
            rig.move((0.0, 0.0, 4.2e-3), 0.05)
            hashes.append(rig.engine._organs[0].digest)
    assert hashes[0] == hashes[1]


def test_what_is_burnt_between_two_layers_frees_the_upper_one():
    with FlapRig(100.0) as rig:
        assert rig.number("block/sheet/freed") == rig.number("block/base/dead") == 0.0
        rig.hold(1.5)
        freed = rig.number("block/areolar/freed")
        assert 0.0 < freed < 12e-3
        assert rig.number("block/areolar/dead") > rig.number("block/areolar/lost") > 0.0
        heat = rig.engine._heating.heats[0]
        assert abs(heat.imbalance) < 1e-3 * heat.book[0]
        gone = np.flatnonzero((rig.organ.layers == 1) & (rig.organ.solid.volumes > 0.0))
        rig.organ.remove(gone)
        rig.hold(0.1)
        assert rig.number("block/areolar/freed") == pytest.approx(12e-3, rel=1e-5)
        assert rig.number("block/sheet/freed") == pytest.approx(12e-3, rel=1e-5)


def test_fat_takes_less_heat_than_liver():
    with FlapRig() as rig:
        heat, layers = rig.engine._heating.heats[0], rig.organ.layers
        power = np.where(rig.organ.solid.volumes > 0.0, 1e9 * rig.organ.solid.volumes, 0.0)
        for _ in range(5):
            heat.advance(1e-3, power.astype(np.float32))
        middles = heat.rise[heat._corners].mean(axis=1)
        ratio = (911.0 * 2348.0) / (1079.0 * 3540.0)
        inner = rig.organ.mesh.nodes[heat._corners].mean(axis=1)[:, 2]
        base, sheet = middles[inner < -4.5e-3].mean(), middles[(layers == 0) & (inner > -0.6e-3)].mean()
        assert base / sheet == pytest.approx(ratio, rel=0.05)


def test_a_layered_block_keeps_the_contract_of_engines():
    given = {
        "probe/pose": [*IN_FRONT, 0, 0, 0, 1],
        "probe/twist": [0.001, 0, 0, 0, 0, 0],
        "probe/energy": [60.0],
    }
    check_engine(lambda: FemEngine("tissue", params(FLAP, HOOK)), period_ns=4 * MS, inputs=given)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"layers": [FLAP["layers"][0], FLAP["layers"][0]]}, "two layers have the same name: sheet, sheet"),
        ({"layers": [FLAP["layers"][0] | {"thickness": "6 mm"}]}, "layers of 0.006 m fill a block"),
        ({"layers": [FLAP["layers"][0] | {"name": "base"}]}, "'base' is the tissue below all layers"),
        ({"layers": [FLAP["layers"][0] | {"material": "fad"}]}, "no material 'fad'"),
        ({"layers": [FLAP["layers"][0] | {"thickness": "1 um"}]}, "0.001 mm high"),
        ({"layers": [FLAP["layers"][0] | {"thickness": "5.999 mm"}]}, "0.001 mm high"),
        ({"size": None, "shape": "colon"}, "layers are those of a block"),
    ],
)
def test_layers_that_cannot_be_are_refused(change, problem):
    with pytest.raises(ValueError, match=problem):
        organ_params(**change)


def test_tissue_in_bullet_has_no_layers():
    with pytest.raises(ValueError, match="only tissue of kind fem has layers"):
        BulletParams.model_validate({"organs": {"block": FLAP | {"cutting": None}}})


def test_layers_need_no_spring_in_series():
    model = FemParams.model_validate({"organs": {"block": FLAP | {"cutting": None}}})
    assert not model.has_series("probe")
