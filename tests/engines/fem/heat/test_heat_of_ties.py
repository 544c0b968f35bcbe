"""Heat through the ties of organs that hang together."""

import numpy as np
import pytest

from engines.fem.heat.tissue import TISSUES
from tests.engines.fem.test_attachments import AREA, PlateRig

HOOK = {"radius": "1 mm", "energy": {"power": "20 W", "efficiency": 1.0}}


def plate(**changes):
    """Return a flap on a bed, and an electrode far away."""
    return PlateRig(HOOK, (0.0, 0.0, 0.05), gravity=0.0, **changes)


def warm(heat, rise):
    heat.warm(np.arange(len(heat.rise)), rise * heat.capacity)


def test_the_flow_is_that_of_a_layer_between_two_temperatures():
    with plate() as rig:
        bed, flap = rig.engine._heating.heats
        warm(flap, 10.0)
        before = flap.stored
        seconds = 1e-3
        rig.ties.conduct((bed, flap), seconds)
        gap = 0.3e-3
        assert before - flap.stored == pytest.approx(0.35 * AREA * 10.0 / gap * seconds, rel=0.03)
        assert bed.stored == pytest.approx(before - flap.stored, rel=1e-6)


def test_the_book_closes_and_both_sides_come_to_one_temperature():
    with plate() as rig:
        bed, flap = rig.engine._heating.heats
        warm(flap, 20.0)
        whole = flap.stored + bed.stored
        for _ in range(600):
            rig.ties.conduct((bed, flap), 0.1)
        assert flap.stored + bed.stored == pytest.approx(whole, rel=1e-9)
        for heat in (bed, flap):
            assert abs(heat.imbalance) < 1e-6 * whole
        nodes = rig.flap.solid.tetrahedra[rig.ties._element, rig.ties._corner]
        faces = rig.engine._organs[0].solid.faces[rig.ties._slot]
        own, its = flap.rise[nodes], (rig.ties.rest[:, :3] * bed.rise[faces]).sum(axis=1)
        assert np.abs(own - its).mean() < 1.0
        assert 0.0 < bed.rise.max() <= 20.0
        assert flap.rise.min() > 0.0


def test_a_long_time_overshoots_nothing():
    with plate() as rig:
        bed, flap = rig.engine._heating.heats
        warm(flap, 20.0)
        rig.ties.conduct((bed, flap), 1e3)
        assert flap.rise.min() >= 0.0
        assert bed.rise.max() <= 20.0 + 1e-9


def test_parted_ties_pass_nothing_and_cold_organs_stay_cold():
    with plate() as rig:
        bed, flap = rig.engine._heating.heats
        rig.ties.conduct((bed, flap), 0.01)
        assert bed.is_cold
        assert flap.is_cold
        warm(flap, 10.0)
        rig.ties.widest[:] = np.inf
        rig.ties.conduct((bed, flap), 0.01)
        assert bed.is_cold


@pytest.mark.long
def test_a_burn_on_the_outside_warms_the_organ_below():
    start = np.array([0.0, 0.7e-3, 4.8e-3 + 0.2e-3])
    with PlateRig(HOOK, start, gravity=0.0) as rig:
        rig.watts[:] = 8.0
        rig.hold(1.0)
        rig.watts[:] = 0.0
        rig.hold(4.0)
        bed = rig.engine._heating.heats[0]
        assert bed.hottest > 37.5
        assert abs(bed.imbalance) < 1e-5 * max(bed.stored, 1.0)
        assert TISSUES["liver"].conductivity > 0.35
