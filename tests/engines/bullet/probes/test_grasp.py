"""Two fingers of three spheres take hold of tissue: when, with which force, and how they lose it."""

from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from engines.bullet.engine import BulletEngine
from engines.bullet.params import BulletParams
from engines.tissue.elasticity.compliance import SurfaceCompliance
from engines.tissue.organs.params import OrganParams
from engines.tissue.probes.held_patch import patch_at
from hub.participant import Inputs, Setup
from hub.testing import check_engine
from tests.engines.bullet.finite_elements import Body, equilibrium
from tests.engines.bullet.rig import BLOCK, IMPULSE, MS

RADIUS = 2e-3
OPEN, SHUT = 5e-3, RADIUS
"""From the middle of the jaw to the centres of a finger's spheres."""
SLAB = {"size": ["60 mm", "40 mm", "12 mm"], "young_modulus": "10 kPa", "nodes": 90}
WALL = {"size": ["6 mm", "30 mm", "20 mm"], "young_modulus": "3 kPa", "nodes": 75}
ABOVE_SLAB, ON_SLAB, ON_WALL = (0.0, 0.0, RADIUS + 1e-3), (0.0, 0.0, RADIUS - 1.5e-3), (0.0, 0.0, -4e-3)


class Jaw:
    """Moves a jaw that points down, its fingers apart along x, on straight lines, and keeps what came out."""

    fingers = 2

    def __init__(self, organ, at, opening=OPEN, *, beside=None, **grasp):
        probe = {
            "spheres": 3 * self.fingers,
            "radius": RADIUS,
            "stiffness": "1 kN/m",
            "grasp": {"fingers": self.fingers, **grasp},
        }
        self.params = BulletParams.model_validate(
            {"organs": {"organ": organ, **(beside or {})}, "probes": {"jaw": probe}, "node_period": "1 ms"}
        )
        self.engine = BulletEngine("tissue", self.params)
        self.outputs = dict(self.engine.configure(Setup(MS, Path(), {"jaw": IMPULSE})))
        self.t, self.at, self.opening = 0, np.array(at, dtype=float), opening
        self.events, self.hashes, self.pulls, self.work = [], [], [], []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.engine.close()

    def spheres(self, at, opening):
        return np.array(
            [at + np.array([side * opening, 3e-3 * i, 0.0]) for side in (-1, 1) for i in (-1, 0, 1)]
        )

    def move(self, seconds, at=None, opening=None):
        start, self.at = (
            self.spheres(self.at, self.opening),
            np.array(self.at if at is None else at, dtype=float),
        )
        self.opening = self.opening if opening is None else opening
        way, steps = self.spheres(self.at, self.opening) - start, round(seconds * 1e3)
        for i in range(steps):
            inputs = Inputs(
                {"jaw/position": (start + way * i / steps).ravel(), "jaw/velocity": (way / seconds).ravel()}
            )
            self.outputs |= self.engine.step(self.t, MS, inputs)
            self.t += MS
            self.events += self.outputs["jaw/events"]
            self.hashes.append(self.engine.state_hash())
            self.work.append(-float(self.outputs["jaw/force"] @ (way / seconds).ravel()) * 1e-3)
            self.pulls.append(float(np.linalg.norm(self.outputs["jaw/pull"])))
        return self

    def close(self):
        return self.move(0.1, opening=SHUT)

    @property
    def kinds(self):
        return [event.event for event in self.events]

    @property
    def held(self):
        return bool(self.outputs["jaw/held"][0])

    @property
    def force(self):
        """Force of the tissue on the jaw, N."""
        return self.outputs["jaw/force"].reshape(-1, 3).sum(axis=0)

    @property
    def nodes(self):
        return self.outputs["organ/nodes"].nodes_m.astype(float).reshape(-1, 3)


def grasp_slab(**grasp):
    return Jaw(SLAB, ABOVE_SLAB, **grasp).move(0.05, at=ON_SLAB).close()


def grasp_wall(**grasp):
    return Jaw(WALL, ON_WALL, **grasp).close()


@pytest.mark.parametrize(
    ("grasp", "way"),
    [(grasp_slab, (0.0, 0.0, 6e-3)), (grasp_slab, (3e-3, 1e-3, -1e-3)), (grasp_wall, (2e-3, 2e-3, 5e-3))],
    ids=["fold-up", "fold-aside-and-down", "wall"],
)
def test_the_pull_is_that_of_finite_elements_whose_held_nodes_are_moved_alike(grasp, way):
    with grasp() as jaw:
        assert jaw.kinds == ["grasped"]
        jaw.move(0.2, at=jaw.at + way).move(0.3)
        body = Body(jaw.params.organs["organ"])
        held = jaw.events[0].nodes
        fixed, nodes = body.fixed.copy(), body.nodes.copy()
        fixed[held] = True
        for share in np.linspace(0.0, 1.0, 6)[1:]:
            nodes[held] = body.nodes[held] + share * (jaw.nodes[held] - body.nodes[held])
            nodes, _ = equilibrium(body.elements, nodes, fixed, load=body.load)
        truth = -(body.elements.forces(nodes) + body.load)[held].sum(axis=0)  # what must hold them there
        assert np.linalg.norm(jaw.outputs["jaw/pull"] - truth) < 0.01 * np.linalg.norm(truth)
        np.testing.assert_allclose(jaw.force, -jaw.outputs["jaw/pull"], atol=0.01 * np.linalg.norm(truth))


def test_with_a_width_the_spring_takes_what_the_mesh_lacks_and_gives_it_back():
    lift = np.array([0.0, 0.0, 4e-3])
    with grasp_slab(width="4 mm") as jaw:
        jaw.move(0.1)
        patch = jaw.engine._probes[0].held_patch
        before = jaw.outputs["jaw/lift"][0], patch.yielded[2]
        jaw.move(0.1, at=jaw.at + lift).move(0.1)
        paid = sum(jaw.work[-200:])
        rose, yielded = jaw.outputs["jaw/lift"][0] - before[0], patch.yielded[2] - before[1]
        assert yielded > 0.5 * lift[2]
        assert rose + yielded == pytest.approx(lift[2], rel=0.1)
        jaw.move(0.1, at=jaw.at - lift).move(0.1)
        assert patch.yielded[2] == pytest.approx(before[1], abs=0.05 * lift[2])
        assert 0.0 < sum(jaw.work[-400:]) < paid
        jaw.move(0.05, opening=OPEN)
        assert jaw.engine._probes[0].held_patch is None


@pytest.mark.parametrize(("width", "converged"), [(4e-3, 55.0), (6e-3, 87.0)])  # N/m: bench/tissue_pull.py
def test_a_patch_is_as_stiff_as_converged_elements_say(width, converged):
    organ = OrganParams.model_validate(BLOCK)
    body = Body(organ)
    rest, faces = organ.rest.nodes, organ.rest.triangles
    surface = SurfaceCompliance(organ.rest, body.fixed, faces[~body.fixed[faces].all(axis=1)], organ.elastic)
    top = faces[(np.abs(rest[faces][..., 2]) < 1e-9).all(axis=1)]
    nodes = top[np.linalg.norm(rest[top].mean(axis=1), axis=1).argmin()]
    missing = patch_at(surface, organ.elastic, nodes, width).missing
    alike = np.tile(np.eye(3), (3, 1))
    mesh = np.linalg.inv(alike.T @ np.linalg.solve(surface.between(nodes), alike))
    assert 1.0 / mesh[2, 2] > 2.0 * converged
    assert 1.0 / (mesh + missing)[2, 2] == pytest.approx(converged, rel=0.06)


def test_a_width_needs_tissue_that_is_anchored():
    with pytest.raises(ValidationError, match=r"grasp\.width needs organs that are anchored"):
        Jaw({**SLAB, "anchors": []}, ABOVE_SLAB, width="4 mm")


def test_a_width_counts_for_one_organ_alone(caplog):
    left, right = ({**WALL, "position": [x, 0, 0]} for x in ("-3.1 mm", "3.1 mm"))
    with Jaw(left, ON_WALL, opening=9e-3, beside={"other": right}, width="4 mm") as jaw:
        jaw.close()
        assert jaw.held
        assert jaw.engine._probes[0].held_patch is None
    assert caplog.text.count("holds 'organ' and 'other': its grasp.width counts for one organ alone") == 1


def test_opening_lets_go_and_the_tissue_goes_back():
    with Jaw(SLAB, ABOVE_SLAB) as jaw:
        before = jaw.nodes
        jaw.move(0.05, at=ON_SLAB).close()
        jaw.move(0.1, at=(0.0, 0.0, 5e-3))
        assert jaw.held
        assert jaw.outputs["jaw/lift"][0] == pytest.approx(5e-3, abs=2e-3)
        jaw.move(0.05, opening=OPEN)
        assert jaw.kinds == ["grasped", "released"]
        assert not jaw.held
        assert jaw.outputs["jaw/lift"][0] == 0.0
        jaw.move(0.2, at=(0.0, 0.0, 15e-3))
        np.testing.assert_allclose(jaw.nodes, before, atol=2e-4)
        assert np.abs(jaw.force).max() < 1e-3
        jaw.move(0.2, at=ON_SLAB).close()
        assert jaw.kinds == ["grasped", "released", "grasped"]


def test_too_strong_a_pull_tears_loose_and_only_opening_makes_ready_again():
    with grasp_slab(hold="1 N") as jaw:
        jaw.move(0.2, at=(0.0, 0.0, 8e-3))
        grasped, torn = jaw.events
        assert (grasped.event, torn.event, torn.body) == ("grasped", "torn", "organ")
        assert torn.nodes.tolist() == grasped.nodes.tolist()
        assert 1.0 < torn.force_n < 1.1
        assert max(jaw.pulls) < 1.1
        assert not jaw.held
        jaw.move(0.1, at=ON_SLAB).move(0.05)
        assert len(jaw.events) == 2
        jaw.move(0.05, opening=OPEN).close()
        assert jaw.kinds == ["grasped", "torn", "grasped"]


@pytest.mark.parametrize(
    ("start", "moves"),
    [
        ((0.0, 0.0, RADIUS + 2e-3), [{"opening": SHUT}]),
        (ABOVE_SLAB, [{"opening": SHUT}, {"at": ON_SLAB}]),
        (ABOVE_SLAB, [{"at": ON_SLAB}, {"at": (2e-3, 0.0, RADIUS - 1e-3)}]),
    ],
    ids=["closing-above-tissue", "pressing-while-closed", "pressing-while-open"],
)
def test_only_closing_on_tissue_takes_hold(start, moves):
    with Jaw(SLAB, start) as jaw:
        for move in moves:
            jaw.move(0.1, **move)
        assert not jaw.events
        assert not np.any(jaw.pulls)


def test_within_reach_means_within_reach():
    with grasp_wall(reach="1 mm") as near, grasp_wall(reach="4 mm") as far:
        assert set(near.events[0].nodes) < set(far.events[0].nodes)


def test_a_grasp_comes_out_the_same_again():
    hashes = []
    for _ in range(2):
        with grasp_wall(hold="0.05 N") as jaw:
            jaw.move(0.1, at=(0.0, 0.0, 4e-3)).move(0.02, opening=OPEN)
            assert jaw.kinds == ["grasped", "torn"]
            hashes.append(jaw.hashes)
    assert hashes[0] == hashes[1]


class Hand(Jaw):
    """Two opposed fingers along x and one from -y, each of three spheres above each other."""

    fingers = 3

    def spheres(self, at, opening):
        return np.array(
            [
                at + np.array([x * opening, y * opening, -4e-3 * i])
                for x, y in ((1, 0), (-1, 0), (0, -1))
                for i in range(3)
            ]
        )


def test_three_fingers_close_on_a_post_and_lift_it():
    post = {"size": ["12 mm", "12 mm", "24 mm"], "young_modulus": "5 kPa", "nodes": 75}
    with Hand(post, (0.0, 0.0, -2e-3), opening=10e-3) as hand:
        hand.move(0.15, opening=7e-3)
        assert hand.kinds == ["grasped"]
        assert hand.held
        hand.move(0.1, at=(0.0, 0.0, 2e-3)).move(0.1)
        assert hand.outputs["jaw/lift"][0] > 2e-3
        assert hand.force[2] < -0.05


@pytest.mark.parametrize("bonds", [{}, {"jaw": IMPULSE}], ids=["alone", "bonded"])
def test_the_engine_keeps_its_contract(bonds):
    small = {**SLAB, "nodes": 18, "young_modulus": "3 kPa"}
    params = BulletParams.model_validate(
        {"organs": {"organ": small}, "probes": {"jaw": {"spheres": 2, "grasp": {}}}}
    )
    check_engine(lambda: BulletEngine("tissue", params), period_ns=MS, bonds=bonds)


@pytest.mark.parametrize(
    "wrong", [{"spheres": 5}, {"spheres": 6, "fingers": 4}, {"spheres": None}, {"spheres": 6, "hold": "0 N"}]
)
def test_fingers_need_spheres(wrong):
    grasp = {key: wrong[key] for key in wrong.keys() & {"fingers", "hold"}}
    with pytest.raises(ValidationError):
        BulletParams.model_validate(
            {"organs": {"organ": SLAB}, "probes": {"jaw": {"spheres": wrong["spheres"], "grasp": grasp}}}
        )
