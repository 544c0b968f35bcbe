"""The spheres of a bond in C: against the bond's force side in Python, and faces against those in numpy."""

import platform
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engines.fem.place import find_place
from engines.fem.probe import Probe
from engines.fem.spheres import Spheres, near_faces
from engines.tissue.meshing.grid import block
from engines.tissue.probes import near_faces as in_numpy
from engines.tissue.probes import place as place_in_numpy
from engines.tissue.probes.params import ProbeParams
from hub.participant import BondPlan, ForceSide, Inputs
from schemas.ports import BondSide

STEP_S, SUB_STEPS = 2e-3, 3


@pytest.mark.parametrize("mean", [True, False])
@pytest.mark.parametrize("prediction", ["hold", "velocity", "slope"])
@pytest.mark.parametrize(("dof", "points"), [(6, 1), (3, 2)])
def test_reaction_and_work_are_those_of_the_force_side(dof, points, prediction, mean):
    bond, plan = BondSide(name="tip", side="force", dof=dof, points=points), BondPlan(prediction, mean)
    params = ProbeParams(spheres=None if dof == 6 else points)
    probe = Probe(params, bond, plan, spheres := Spheres(params.radii, SUB_STEPS), 0)
    side, random = ForceSide(bond, plan), np.random.default_rng(0)
    place, speed = ("pose", "twist") if dof == 6 else ("position", "velocity")
    nothing, dt = np.zeros(bond.size), STEP_S / SUB_STEPS
    for _ in range(4):
        values = {
            f"tip/{place}": random.standard_normal(7 if dof == 6 else bond.size),
            f"tip/{speed}": random.standard_normal(bond.size),
        }
        spheres.forces[:] = random.standard_normal(spheres.forces.shape)
        side.begin(Inputs(values), STEP_S)
        probe.begin(Inputs(values), STEP_S)
        for i in range(SUB_STEPS + 1):
            np.testing.assert_allclose(spheres.path[i].ravel(), side.position(i * dt), rtol=1e-12)
        for i, forces in enumerate(spheres.forces):
            pushed = np.zeros(bond.size)
            pushed[: forces.size] = -forces.ravel()
            side.add(pushed, nothing, (i + 0.5) * dt, dt)
        assert probe.end()
        for port, value in side.result(pushed, nothing).items():
            np.testing.assert_allclose(probe.outputs[port], value, rtol=1e-12, atol=1e-15)


def test_a_motion_of_another_size_is_refused():
    bond, plan = BondSide(name="tip", side="force", dof=3, points=2), BondPlan("velocity", mean=True)
    probe = Probe(ProbeParams(spheres=2), bond, plan, Spheres(np.ones(2), 1), 0)
    with pytest.raises(ValueError, match="2 spheres got a motion of another size"):
        probe.begin(Inputs({"tip/position": np.zeros(3), "tip/velocity": np.zeros(6)}), STEP_S)


@given(st.integers(0, 2**32 - 1), st.integers(0, 3))
def test_near_faces_are_those_of_numpy(seed, room):
    mesh, random = block(np.array([0.04, 0.04, 0.02]), 60), np.random.default_rng(seed)
    centres = random.uniform(-0.03, 0.03, (3, 3))
    reach = random.uniform(1e-3, 2e-2, 3)
    found = near_faces(centres, reach, mesh.nodes, mesh.triangles, room)
    expected = in_numpy.near_faces(centres, reach, mesh.nodes, mesh.triangles)
    np.testing.assert_array_equal(found.spheres, expected.spheres)
    np.testing.assert_array_equal(found.faces, expected.faces)
    np.testing.assert_allclose(found.distances, expected.distances, rtol=1e-5)
    np.testing.assert_allclose(found.weights, expected.weights, atol=1e-3)


def test_faces_of_another_type_are_refused():
    mesh, centre = block(np.array([0.04, 0.04, 0.02]), 60), np.zeros((1, 3))
    with pytest.raises(TypeError, match="faces are of type int64, not 'i'"):
        near_faces(centre, np.full(1, 5e-3), mesh.nodes, mesh.triangles.astype(np.int32))


@given(st.integers(0, 2**32 - 1))
def test_a_place_on_a_surface_is_that_of_numpy(seed):
    """To the bit where einsum of numpy has no fused products, so recordings of either verify."""
    mesh, random = block(np.array([0.04, 0.04, 0.02]), 60), np.random.default_rng(seed)
    surface = SimpleNamespace(settled=mesh.nodes)
    centre, radius = random.uniform((-0.02, -0.02, 0.0), (0.02, 0.02, 4e-3)), random.uniform(1e-3, 8e-3)
    near = near_faces(centre[None], np.full(1, radius + 6e-3), mesh.nodes, mesh.triangles)
    if not len(near.spheres):
        return
    found, expected = (one(surface, near, radius) for one in (find_place, place_in_numpy.find_place))
    for name in ("nodes", "parts", "first_parts", "point", "inward", "distance"):
        one, other = getattr(found, name), getattr(expected, name)
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-15, err_msg=name)
        assert platform.machine() not in {"x86_64", "AMD64"} or np.array_equal(one, other), name
