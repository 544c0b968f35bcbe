"""An electrosurgical instrument on tissue: total power, jaws, commands without sense, a coagulated track."""

import logging

import numpy as np
import pytest

from engines.bullet.params import BulletParams
from engines.fem.engine import FemEngine
from engines.fem.heat.heat import Heat
from engines.fem.heat.instrument import EnergyInstrument
from engines.fem.heat.tissue import TISSUES
from engines.tissue.meshing.grid import grid_indices, tetrahedra_of_cells
from engines.tissue.meshing.tet_mesh import volumes
from engines.tissue.probes.energy import EnergyParams
from hub.participant import Inputs
from hub.testing import check_engine
from schemas.soft_surface import FaceKind
from tests.engines.fem.rig import MS, FemRig, params

SLAB = {"size": ["20 mm", "10 mm", "5 mm"], "young_modulus": "10 kPa", "nodes": 1400}
RADIUS = 1e-3
ON_SLAB = (-5e-3, 0.0, RADIUS - 0.5e-3)


def cautery(**energy):
    return {"radius": RADIUS, "energy": energy}


class CauteryRig(FemRig):
    """`FemRig` with a command of power."""

    def __init__(self, slab=SLAB, start=ON_SLAB, **energy):
        super().__init__(params(slab, cautery(**energy)), start=start)
        self.watts, self.events = np.zeros(1), []
        self.inputs = Inputs({"probe/pose": self.pose, "probe/twist": self.twist, "probe/energy": self.watts})

    def follow(self, motion, seconds):
        for i in range(round(seconds * 1e9 / self.period)):
            t = i * self.period * 1e-9
            super().follow(lambda dt, t=t: motion(t + dt), self.period * 1e-9)
            self.events += self.outputs["block/events"]

    @property
    def heat(self):
        return self.engine._heating.heats[0]

    def number(self, port):
        return float(self.outputs[port][0])


def unit_block():
    points = 1e-3 * (grid_indices(9, 9, 9) - 4.0)
    corners = tetrahedra_of_cells((8, 8, 8))
    gradients = (
        np.linalg.inv(points[corners[:, 1:]] - points[corners[:, :1]]).transpose(0, 2, 1).reshape(-1, 9)
    )
    return (
        Heat([TISSUES["liver"]], corners, gradients, volumes(points, corners), len(points)),
        points,
        corners,
    )


def inputs(watts, *, stale=False):
    return Inputs({"hook/energy": np.array([watts])}, stale={"hook/energy"} if stale else set())


@pytest.mark.parametrize(
    ("watts", "stale", "expected"),
    [
        (30.0, False, 15.0),
        (1e12, False, 30.0),
        (np.inf, False, 30.0),
        (np.nan, False, 0.0),
        (-5.0, False, 0.0),
        (30.0, True, 0.0),
    ],
)
def test_a_command_is_within_the_bounds_of_the_generator(watts, stale, expected):
    heat, points, _ = unit_block()
    instrument = EnergyInstrument("hook", EnergyParams(power=60.0, efficiency=0.5), np.array([1e-3]))
    for _ in range(10):
        instrument.listen(inputs(watts, stale=stale), 1e-3)
    poles = instrument.poles(np.zeros((1, 3)), np.ones(1, bool))
    found = instrument.deposit([heat], [points], poles, [1e-3])
    assert instrument.numbers[1] == pytest.approx(0.01 * expected)
    assert float(sum(map(np.sum, found))) == pytest.approx(0.01 * expected, rel=1e-6)


@pytest.mark.parametrize("mode", ["monopolar", "bipolar"])
def test_heat_is_that_of_point_currents_in_an_infinite_body(mode):
    heat, points, corners = unit_block()
    middles = points[corners].mean(axis=1)
    instrument = EnergyInstrument("jaws", EnergyParams(mode=mode), np.full(2, 0.2e-3))
    at = np.array([[-2e-3, 0.0, 0.0], [2e-3, 0.0, 0.0]])
    shares, total = heat.spread(points, instrument.poles(at, np.ones(2, bool)), 3e-3)
    apart = middles[:, None] - at
    distance = np.linalg.norm(apart, axis=2)
    signs = np.array([1.0, -1.0 if mode == "bipolar" else 1.0])
    current = (signs[:, None] * apart / distance[:, :, None] ** 3).sum(axis=1)
    truth = volumes(points, corners) * (current**2).sum(axis=1) * (distance.min(axis=1) < 3e-3)
    np.testing.assert_allclose(shares / total, truth / truth.sum(), rtol=1e-4)
    alone = instrument.poles(at, np.array([True, False]))
    assert len(alone) == (0 if mode == "bipolar" else 1)


@pytest.mark.parametrize(
    ("edges", "is_heated"), [([1e-3, 1e-3], False), ([1e-2, 1e-3], False), ([1e-3, 1e-2], True)]
)
def test_a_coarse_body_widens_the_reach_of_a_current_in_itself_alone(edges, is_heated):
    (near, points, _), (far, others, _) = unit_block(), unit_block()
    others = others + np.array([points[:, 0].max() - others[:, 0].min() + 4e-3, 0.0, 0.0])
    instrument = EnergyInstrument("hook", EnergyParams(), np.array([0.5e-3]))
    instrument.listen(inputs(30.0), 1e-3)
    at = np.array([[points[:, 0].max(), 0.0, 0.0]])
    one, other = instrument.deposit(
        [near, far], [points, others], instrument.poles(at, np.ones(1, bool)), edges
    )
    assert one.sum() > 0.0
    assert bool(other.sum() > 0.0) is is_heated


def test_insulated_spheres_conduct_nothing_and_press_all_the_same():
    instrument = EnergyInstrument("hook", EnergyParams(bare=2), np.array([0.6e-3, 0.6e-3, 1.1e-3]))
    poles = instrument.poles(np.zeros((3, 3)), np.ones(3, bool))
    assert poles[:, 3:].tolist() == [[0.6e-3, 0.5], [0.6e-3, 0.5]]
    assert len(instrument.poles(np.zeros((3, 3)), np.array([False, False, True]))) == 0
    assert instrument.reach == pytest.approx(4.0 * 0.6e-3)


@pytest.mark.long
def test_a_cutting_current_takes_more_tissue_away_and_leaves_less_of_it_hot():
    gone, hottest = [], []
    for effect in ("coag", "cut"):
        with CauteryRig({**SLAB, "cutting": {}}, effect=effect, power=150.0, efficiency=1.0) as rig:
            rig.watts[:] = 150.0
            rig.move((-3e-3, 0.0, ON_SLAB[2]), 0.6)
            gone.append(rig.heat.book[3])
            hottest.append(rig.number("block/hottest"))
            assert abs(rig.heat.imbalance) < 1e-3 * rig.heat.book[0]
    assert gone[1] > gone[0] > 0.0
    assert hottest[1] < hottest[0]


@pytest.mark.long
def test_power_without_contact_heats_nothing_and_is_said_once(caplog):
    with CauteryRig(start=(0.0, 0.0, 0.02)) as rig, caplog.at_level(logging.WARNING):
        rig.watts[:] = 30.0
        rig.hold(1.2)
        assert rig.number("probe/delivered") == 0.0
        assert rig.heat.is_cold
        assert rig.number("block/hottest") == 37.0
    assert len([record for record in caplog.records if "power without contact" in record.message]) == 1


@pytest.mark.long
def test_a_moving_hook_leaves_a_coagulated_track():
    """Half width to 60 degrees of a point source of 15 W at 5 mm/s, without boiling: 2.7 mm; of pig wall cut
    with 60 W: 0.15 mm (Homayounfar et al. 2012).
    """
    with CauteryRig() as rig:
        rig.move(ON_SLAB, 0.05)
        rig.watts[:] = 30.0
        rig.move((5e-3, 0.0, ON_SLAB[2]), 2.0)
        rig.watts[:] = 0.0
        rig.hold(0.2)
        assert rig.number("probe/delivered") == pytest.approx(30.0, rel=0.02)
        assert rig.number("block/hottest") > 60.0
        heat = rig.heat
        assert heat.book[0] == pytest.approx(rig.number("probe/delivered"), rel=1e-6)
        assert abs(heat.imbalance) < 1e-5 * heat.book[0]
        middles = rig.engine._organs[0].mesh.nodes[heat._corners].mean(axis=1)
        burnt = (heat.kinds >= FaceKind.COAGULATED) & (np.abs(middles[:, 0]) < 4e-3)
        assert 0.15e-3 < -middles[burnt, 2].min() < 2.7e-3
        assert 0.15e-3 < np.abs(middles[burnt, 1]).max() < 2.7e-3
        assert {(one.kind, one.instrument, one.unit) for one in rig.events} == {("burnt", "probe", "m^3")}
        organ = rig.engine._organs[0]
        told, gathered = sum(one.size for one in rig.events), organ.events.state[0][..., 0].sum()
        assert told > 0.5 * gathered
        assert told + gathered == pytest.approx(organ.solid.elements[2][heat.kinds > 0].sum(), rel=1e-6)


def test_a_burn_is_saved_and_restored_to_the_bit():
    with CauteryRig({**SLAB, "nodes": 200}) as rig:
        rig.watts[:] = 40.0
        rig.hold(0.3)
        saved, time, hashes = rig.engine.save(), rig.t, []
        for _ in range(2):
            rig.t, rig.hashes = time, []
            rig.hold(0.1)
            hashes.append(rig.hashes)
            rig.engine.restore(saved)
        assert hashes[0] == hashes[1]
        assert rig.number("block/hottest") > 60.0


def test_the_engine_keeps_its_contract_with_power():
    model = params({**SLAB, "nodes": 200}, cautery())
    given = {
        "probe/pose": [0, 0, 0.9e-3, 0, 0, 0, 1],
        "probe/twist": [0.001, 0, 0, 0, 0, 0],
        "probe/energy": [30.0],
    }
    check_engine(lambda: FemEngine("tissue", model), period_ns=4 * MS, inputs=given)


def test_half_of_the_spheres_is_a_jaw():
    with pytest.raises(ValueError, match="one half of them is one jaw"):
        params(SLAB, {"spheres": 3, "energy": {"mode": "bipolar"}})


def test_tissue_in_bullet_is_not_heated():
    with pytest.raises(ValueError, match="kind fem only"):
        BulletParams.model_validate({"organs": {"block": SLAB}, "probes": {"probe": cautery()}})


@pytest.mark.long
def test_vaporised_tissue_goes_and_leaves_charred_walls():
    with CauteryRig(SLAB | {"cutting": {}}, power="400 W", efficiency=1.0) as rig:
        solid = rig.engine._organs[0].solid
        mass = float(solid.mass.sum(dtype=np.float64))
        rig.watts[:] = 400.0
        rig.hold(1.0)
        assert float(solid.mass.sum(dtype=np.float64)) < 0.995 * mass
        kinds = rig.outputs["block/surface"].kinds
        assert (kinds == FaceKind.CHARRED).any()
        assert (kinds == FaceKind.COAGULATED).any()
        assert not len(rig.heat.vaporised())
        assert abs(rig.heat.imbalance) < 1e-3 * rig.heat.book[0]
