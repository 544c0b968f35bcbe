"""Organs anchored to a probe: the surface goes with the probe, and the probe feels the organ."""

import numpy as np
import pytest
from pydantic import ValidationError

from engines.bullet.params import BulletParams
from tests.engines.fem.rig import FemRig, params

BLOCK = {"size": ["40 mm", "40 mm", "20 mm"], "young_modulus": "10 kPa", "nodes": 120}
CARRIED = {**BLOCK, "anchors": [{"surface": "bottom", "to": "probe"}]}
WEIGHT_N = 9.80665 * 1000.0 * 40e-3 * 40e-3 * 20e-3


def carried(**rest):
    return FemRig(params(CARRIED, {"spheres": 1}, **rest), start=(0.0, 0.0, 0.1))


def test_the_surface_goes_with_the_probe_and_the_rest_follows():
    with carried() as rig:
        before = rig.nodes
        rig.follow(
            lambda t: (
                np.array([5e-3 * (1 - np.cos(np.pi * t)) / 2, 0.0, 0.1]),
                np.array([5e-3 * np.pi * np.sin(np.pi * t) / 2, 0.0, 0.0]),
            ),
            1.0,
        )
        rig.hold(0.5)
        moved = rig.nodes - before
        held = rig.engine._organs[0].anchored
        assert np.allclose(moved[held], [5e-3, 0.0, 0.0], atol=2e-5)
        assert np.allclose(moved[~held], [5e-3, 0.0, 0.0], atol=2e-4)


def test_the_probe_bears_the_weight_and_touches_nothing():
    with carried() as rig:
        rig.hold(0.3)
        assert rig.force[2] == pytest.approx(-WEIGHT_N, rel=0.02)
        assert abs(rig.force[0]) < 0.01 * WEIGHT_N
        assert not rig.engine._probes[0].touching.any()


def test_a_saved_state_goes_on_in_every_bit():
    with carried() as rig, carried() as other:
        rig.move((0.0, 2e-3, 0.1), 0.05)
        other.engine.restore(rig.engine.save())
        other.at[...], other.t = rig.at, rig.t
        for one in (rig, other):
            one.move((0.0, 0.0, 0.1), 0.05)
        assert rig.hashes[-50:] == other.hashes


def test_its_stiffness_is_that_of_the_layer_that_moves():
    """A rigid motion of all nodes has none; of one face of the block at most that of a column beside it."""
    model = params(CARRIED, {"spheres": 1})
    organ = model.organs["block"]
    every = np.ones(len(organ.rest.nodes), np.bool_)
    assert organ.patch_stiffness(every) == pytest.approx(0.0, abs=1e-6)
    bottom = organ.anchored_nodes["probe"]
    mu, lambda_ = organ.elastic.lame
    heights = np.sort(np.unique(organ.rest.nodes[:, 2].round(6)))
    thinnest = float(np.diff(heights).min())
    column = (lambda_ + 2 * mu) * 40e-3 * 40e-3
    assert column / 20e-3 < organ.patch_stiffness(bottom) <= column / thinnest
    assert model.contact_stiffness("probe") == organ.patch_stiffness(bottom)
    assert not model.has_sub_grid("probe")


@pytest.mark.parametrize(
    ("make", "organ", "probe", "expected"),
    [
        (params, {"to": "prob"}, {"spheres": 1}, "nor a probe with `spheres: 1`. Did you mean 'probe'"),
        (params, {"to": "probe"}, {"spheres": 2}, "nor a probe with `spheres: 1`"),
        (params, {"to": "probe"}, {}, "nor a probe with `spheres: 1`"),
    ],
)
def test_parts_that_cannot_carry(make, organ, probe, expected):
    with pytest.raises(ValidationError) as caught:
        make({**BLOCK, "anchors": [{"surface": "bottom", **organ}]}, probe)
    assert expected in str(caught.value)


def test_bullet_has_no_moving_anchors():
    given = {"organs": {"block": CARRIED}, "probes": {"probe": {"spheres": 1}}}
    with pytest.raises(ValidationError, match="anchored to 'probe', which is not a rigid part"):
        BulletParams.model_validate(given)
