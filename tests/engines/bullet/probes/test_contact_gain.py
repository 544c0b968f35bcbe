"""The force on a probe, against what the tissue receives and against finite elements of the same mesh."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engines.bullet.elasticity.forces import Elasticity
from tests.engines.bullet.finite_elements import Body, internal_forces
from tests.engines.bullet.rig import BLOCK, RADIUS, SMALL_BLOCK, Rig, params

SLAB = {"size": ["24 mm", "24 mm", "16 mm"], "young_modulus": "10 kPa", "nodes": 250}
FINE = {"timestep": "0.5 ms"}
"""What the slab's mesh, of edges of 4 mm, needs."""


def presses(model, at, depths):
    """Yield depth (m), force on the probe (N) and nodes (m) at rest at every depth.

    `at`: of the spheres, m, shape (2,) or (k, 2).
    """
    radii = model.probes["probe"].radii if np.ndim(at) > 1 else model.probes["probe"].radii[0]

    def centres(depth):
        return np.concatenate([at, np.reshape(radii - depth, (*np.shape(at)[:-1], 1))], axis=-1)

    with Rig(model, start=centres(-1e-3)) as rig:
        rig.hold(0.016)
        for depth in depths:
            rig.move(centres(depth), 0.096)
            rig.hold(0.128)
            yield centres(depth), rig.force, rig.nodes


@pytest.mark.long
@pytest.mark.parametrize(
    "at", [(0.0, 0.0), (5e-3, 0.0), (4e-3, 3e-3), (2e-3, 1e-3)], ids=["node", "edge", "face", "off-node"]
)
@pytest.mark.parametrize("organ", [BLOCK, {**BLOCK, "young_modulus": "25 kPa"}], ids=["soft", "stiff"])
def test_the_tissue_receives_what_the_probe_feels(organ, at):
    model = params(organ)
    body = Body(model.organs["block"])
    for _, force, nodes in presses(model, at, (2e-3, 5e-3)):
        np.testing.assert_allclose(force, body.reaction(nodes), atol=0.02 * np.linalg.norm(force))


@pytest.mark.long
@pytest.mark.parametrize("radius", [2e-3, 5e-3])
@pytest.mark.parametrize(
    ("organ", "rest", "at"),
    [(BLOCK, {}, (0.0, 0.0)), (BLOCK, {}, (4e-3, 3e-3)), (SLAB, FINE, (0.0, 0.0))],
    ids=["coarse", "coarse, face", "fine"],
)
def test_the_force_at_a_depth_is_that_of_finite_elements(organ, rest, at, radius):
    model = params(organ, probe={"radius": radius}, **rest)
    body = Body(model.organs["block"], friction=None if any(at) else 0.0)  # over a node nothing slides
    for centre, force, _ in presses(model, at, (1e-3, 3e-3, 5e-3)):
        assert force[2] == pytest.approx(body.press([centre], [radius])[0, 2], rel=0.1)


@pytest.mark.long
def test_each_of_several_spheres_feels_what_it_does():
    # on neighbouring faces
    at, radii = np.array([[-12e-3, 0.0], [0.0, 5e-3], [8e-3, -7e-3]]), [2e-3, 3e-3, 5e-3]
    model = params(BLOCK, probe={"spheres": 3, "radius": radii})
    body = Body(model.organs["block"])
    for centres, forces, nodes in presses(model, at, (1e-3, 2e-3, 4e-3)):
        np.testing.assert_allclose(
            forces.sum(axis=0), body.reaction(nodes), atol=0.02 * np.linalg.norm(forces.sum(axis=0))
        )
        np.testing.assert_allclose(forces[:, 2], body.press(centres, radii)[:, 2], atol=0.1 * forces.max())


def test_the_force_follows_that_of_finite_elements_at_5_hz():
    model, w = params(SMALL_BLOCK), 10 * np.pi
    body = Body(model.organs["block"])
    with Rig(model, start=(0.0, 0.0, RADIUS)) as rig:
        rig.move((0.0, 0.0, RADIUS - 3e-3), 0.1)
        forces = rig.follow(
            lambda t: (
                [0.0, 0.0, RADIUS - 3e-3 - 2e-3 * np.sin(w * t)],
                [0.0, 0.0, -2e-3 * w * np.cos(w * t)],
            ),
            0.6,
        )[200:, 2]
    depths = np.linspace(1e-3, 5e-3, 9)
    curve = [body.press([[0.0, 0.0, RADIUS - depth]], [RADIUS])[0, 2] for depth in depths]
    ends = np.arange(201, 601) * 1e-3
    # the force is the mean of a step
    truth = np.interp(3e-3 + 2e-3 * np.sin(w * (ends - 0.5e-3)), depths, curve)
    assert np.corrcoef(forces, truth)[0, 1] > 0.999


@pytest.mark.long
def test_a_drag_is_felt_as_much_by_the_tissue():
    model = params(BLOCK)
    body = Body(model.organs["block"])
    with Rig(model, start=(0.0, 0.0, RADIUS + 1e-3)) as rig:
        rig.move((0.0, 0.0, RADIUS - 3e-3), 0.096)
        rig.move((12e-3, 0.0, RADIUS - 3e-3), 0.608)
        truth = body.reaction(rig.nodes)
        assert rig.force[0] < -0.05  # friction pulls back
        assert np.linalg.norm(rig.force - truth) < 0.05 * np.linalg.norm(truth)
        assert abs(rig.force[0]) <= 0.5 * rig.force[2]


@given(st.integers(0, 2**32 - 1), st.floats(1e-5, 1e-3))
def test_elastic_forces_are_those_of_finite_elements(seed, size):
    organ = params(SMALL_BLOCK).organs["block"]
    random = np.random.default_rng(seed)
    nodes, at = (
        organ.rest.nodes + size * random.standard_normal(organ.rest.nodes.shape),
        random.random(len(organ.rest.nodes)) < 0.2,
    )
    expected = internal_forces(
        organ.rest.nodes, organ.rest.tetrahedra, nodes, *organ.elastic.neo_hookean_lame
    )
    forces = Elasticity(organ.rest, organ.elastic).forces(nodes, at)
    np.testing.assert_allclose(forces[at], expected[at], atol=1e-9 * np.abs(expected).max())
    assert not forces[~at].any()
