"""What the stated limits of the time step are worth."""

import numpy as np
import pytest

from engines.bullet.elasticity import stable_step
from engines.bullet.elasticity.stable_step import longest_step
from engines.bullet.organs.organ import Organ
from engines.bullet.organs.params import OrganParams
from engines.bullet.world import connect, disconnect
from schemas.errors import SessionError
from tests.engines.bullet.rig import RADIUS, SMALL_BLOCK, Rig, params


@pytest.mark.parametrize("damping_ns", [0, 100_000])
@pytest.mark.parametrize(("ratio", "stable"), [(0.97, True), (1.15, False)])
def test_free_tissue_is_stable_up_to_the_longest_step(damping_ns, ratio, stable):
    organ_params = OrganParams.model_validate({**SMALL_BLOCK, "damping": damping_ns * 1e-9})
    client = connect("test", 1e-3, 9.81)
    try:
        organ = Organ("block", organ_params, client)
        import pybullet

        pybullet.setTimeStep(ratio * longest_step(organ.frequency, damping_ns * 1e-9), physicsClientId=client)
        for _ in range(1500):
            pybullet.stepSimulation(physicsClientId=client)
        if stable:
            organ.sample(0)
            assert np.abs(organ.nodes - organ.mesh.nodes).max() < 1e-3
        else:
            with pytest.raises(SessionError, match="unstable"):
                organ.sample(0)
    finally:
        disconnect(client)


def ripple(phase, monkeypatch):
    """Return the ripple of the force over its mean, at `phase` = timestep x highest frequency."""
    monkeypatch.setattr(stable_step, "_LARGEST_PHASE", 10.0)
    mesh = OrganParams.model_validate(SMALL_BLOCK).rest
    free = np.where(mesh.nodes[:, 2] > mesh.nodes[:, 2].min(), 1.0, 0.0)
    soft = OrganParams.model_validate(SMALL_BLOCK)
    young_modulus = (
        soft.young_modulus * (phase / (1e-3 * stable_step.highest_frequency(mesh, free, soft.elastic))) ** 2
    )
    with Rig(
        params({**SMALL_BLOCK, "young_modulus": young_modulus}),
    ) as rig:
        rig.move((0.0, 0.0, RADIUS - 4e-3), 0.15)
        rig.hold(0.1)
        forces = rig.hold(0.1)[:, 2]
    return forces.std() / forces.mean()


def test_a_contact_is_steady_below_the_largest_phase(monkeypatch):
    assert ripple(4.0, monkeypatch) < 0.01


def test_a_contact_chatters_above_it(monkeypatch):
    assert ripple(4.7, monkeypatch) > 0.02
