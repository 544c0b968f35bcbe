"""What the stated limits of the time step are worth."""

import logging

import numpy as np
import pytest

from engines.bullet.elasticity import stable_step
from engines.bullet.elasticity.stable_step import ACCURATE_PHASE, face_loss, longest_step
from engines.bullet.organ import Organ
from engines.bullet.world import connect, disconnect
from engines.tissue.frequencies import highest_frequency
from engines.tissue.organs.params import OrganParams
from schemas.errors import SessionError
from tests.engines.bullet.finite_elements import Body
from tests.engines.bullet.rig import RADIUS, SMALL_BLOCK, Rig, params


@pytest.mark.long
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
    young_modulus = soft.young_modulus * (phase / (1e-3 * highest_frequency(mesh, free, soft.elastic))) ** 2
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


def at_phase(phase):
    """Return the small block, as stiff as sub-steps of 1 ms make `phase`."""
    soft = OrganParams.model_validate(SMALL_BLOCK)
    free = np.where(soft.rest.nodes[:, 2] > soft.rest.nodes[:, 2].min(), 1.0, 0.0)
    frequency = highest_frequency(soft.rest, free, soft.elastic)
    return {**SMALL_BLOCK, "young_modulus": soft.young_modulus * (phase / (1e-3 * frequency)) ** 2}


@pytest.mark.parametrize("phase", [2.0, 3.0])
def test_contacts_in_faces_lose_no_more_force_than_stated(phase):
    block = at_phase(phase)
    mesh = OrganParams.model_validate(block).rest
    top = mesh.nodes[mesh.triangles]
    middles = top[(top[:, :, 2] == mesh.nodes[:, 2].max()).all(axis=1)].mean(axis=1)
    at = middles[np.linalg.norm(middles[:, :2], axis=1).argmin(), :2]
    with Rig(params(block), start=(*at, RADIUS + 1e-3)) as rig:
        rig.move((*at, RADIUS - 1e-3), 0.06)
        rig.hold(0.2)
        force = rig.force[2]
    true = Body(OrganParams.model_validate(block)).press([[*at, RADIUS - 1e-3]], [RADIUS])[0, 2]
    assert 0.02 < 1.0 - force / true < face_loss(phase) + 0.02


@pytest.mark.parametrize(("ratio", "warnings"), [(0.98, 0), (1.1, 1)])
def test_a_session_warns_once_of_a_long_step(ratio, warnings, caplog):
    block = at_phase(ratio * ACCURATE_PHASE)
    with caplog.at_level(logging.WARNING):
        for _ in range(2):
            with Rig(params(block)):
                pass
    assert [record.getMessage().count("too small") for record in caplog.records] == [1] * warnings
