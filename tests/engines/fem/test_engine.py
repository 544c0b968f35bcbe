"""Tissue of our own as an engine: forces of converged finite elements, grasps, starts, and sessions."""

import json
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from engines.bullet.params import BulletParams
from engines.fem.engine import FemEngine
from engines.fem.organ import relaxation
from engines.fem.params import FemParams
from engines.fem.solid import Branch
from engines.tissue.probes.held_patch import patch_at
from hub.participant import Inputs, Setup
from hub.testing import check_engine
from schemas.errors import ScenarioError, SessionError, StateError
from schemas.files import Files
from tests.engines.bullet.rig import IMPULSE
from tests.engines.fem.rig import BLOCK, MS, FemRig, params

CONVERGED = {
    2e-3: [0.01856, 0.05525, 0.09744, 0.13861],
    5e-3: [0.03176, 0.10143, 0.19358, 0.30134],
}
"""Force (N) of a sphere 1, 2, 3 and 4 mm deep in the middle of the block: bench/tissue_truth.json."""


def middle(organ, place):
    """Return the node, or the middle of a face, nearest to the middle of the block's top."""
    top = organ.touchable[(organ.mesh.nodes[organ.touchable][:, :, 2] > -1e-9).all(axis=1)]
    nodes = organ.mesh.nodes
    found = nodes[np.unique(top)] if place == "node" else nodes[top].mean(axis=1)
    return found[np.linalg.norm(found, axis=1).argmin()]


@pytest.mark.parametrize("place", ["node", "face"])
@pytest.mark.parametrize("radius", CONVERGED)
def test_the_force_is_that_of_converged_elements(radius, place):
    with FemRig(params({**BLOCK, "nodes": 250}, {"radius": radius}), start=(0.0, 0.0, 0.5)) as rig:
        at = middle(rig.engine._organs[0], place)
        rig.at[...] = at + np.array([0.0, 0.0, radius + 1e-3])
        for depth, force in zip((1e-3, 2e-3, 3e-3, 4e-3), CONVERGED[radius], strict=True):
            rig.move(at + np.array([0.0, 0.0, radius - depth]), 0.06)
            rig.hold(0.2)
            assert rig.force[2] == pytest.approx(force, rel=0.02)
        assert np.std([wrench[2] for wrench in rig.wrenches[-50:]]) < 1e-4 * rig.force[2]


@pytest.mark.long
def test_the_force_of_a_fine_mesh_is_corrected_too():
    with FemRig(params({**BLOCK, "nodes": 1500}), start=(0.0, 0.0, 6e-3)) as rig:
        rig.move((0.0, 0.0, 2e-3), 0.05)
        rig.hold(0.1)
        assert rig.force[2] == pytest.approx(CONVERGED[5e-3][2], rel=0.03)


SERIES = [{"share": 0.3, "seconds": 0.05}, {"share": 0.2, "seconds": 0.3}]


def test_a_held_press_relaxes_as_its_series_says():
    """From 0.1 s on: earlier the bulk, which does not relax, bears a part of the force."""
    tissue = {**BLOCK, "nodes": 250, "poisson_ratio": 0.4, "prony": SERIES}
    with FemRig(params(tissue), start=(0.0, 0.0, 5.1e-3)) as rig:
        rig.move((0.0, 0.0, 3e-3), 0.02)
        force = rig.hold(1.5)[:, 2]

    def left(t):
        return 1.0 + sum(one["share"] / 0.5 * np.exp(-(t + 0.01) / one["seconds"]) for one in SERIES)

    for t in (0.1, 0.2, 0.4, 0.8):
        ratio = force[round(t * 1e3)] / force[-1]
        assert ratio == pytest.approx(left(t) / left(1.5), rel=0.025)


def test_parameters_without_effect_are_said_once(caplog):
    model = params(probe={"stiffness": "500 N/m", "mass": "1 kg"}, node_period="32 ms")
    FemEngine("here", model)
    FemEngine("here", model)
    assert [record.getMessage().count("stiffness, mass") for record in caplog.records] == [1]


def test_a_material_file_has_its_relaxation_for_fem_alone(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(
        "young_modulus: 8000.0\npoisson_ratio: 0.45\ndensity: 1000.0\ndamping: 0.02\n"
        "long_term_young_modulus: 5000.0\nprony: [{share: 0.4, seconds: 0.1}]\n"
    )
    given = {"organs": {"block": {"size": BLOCK["size"], "material_file": "mine.yaml"}}}
    organ, in_bullet = (
        model.model_validate(given, context=Files(tmp_path).context).organs["block"]
        for model in (FemParams, BulletParams)
    )
    assert (organ.elastic.young_modulus, organ.elastic.damping) == (8e3, 0.02)
    assert (organ.relaxed.young_modulus, organ.relaxed.damping) == (5e3, 1e-3)
    assert relaxation(organ) == [Branch(pytest.approx(2 / 3), 0.1)]
    assert in_bullet.elastic == organ.elastic


def test_bullet_refuses_a_series_and_a_series_leaves_a_solid():
    with pytest.raises(ValueError, match="does not relax"):
        BulletParams.model_validate({"organs": {"block": {**BLOCK, "prony": SERIES}}})
    with pytest.raises(ValueError, match="sum to at most"):
        params({**BLOCK, "prony": [{"share": 0.6, "seconds": 1.0}] * 2})


def test_a_swinging_press_gives_back_no_more_than_it_took():
    with FemRig(params({**BLOCK, "nodes": 250}), start=(0.0, 0.0, 6e-3)) as rig:
        rig.move((0.0, 0.0, 2e-3), 0.1)
        paid = sum(rig.power) * 1e-3
        rig.follow(
            lambda t: (
                np.array([0.0, 0.0, 2e-3 + 1e-3 * np.sin(10.0 * np.pi * t)]),
                np.array([0.0, 0.0, 0.01 * np.pi * np.cos(10.0 * np.pi * t)]),
            ),
            0.4,
        )
        rig.move((0.0, 0.0, 8e-3), 0.1)
        assert paid > 1e-4
        assert 0.0 < sum(rig.power) * 1e-3 < paid


def test_a_pressed_organ_is_saved_and_restored_to_the_bit():
    with FemRig(params({**BLOCK, "nodes": 75}), start=(0.0, 0.0, 6e-3)) as rig:
        rig.move((0.0, 0.0, 3e-3), 0.05)
        saved, at, time = rig.engine.save(), rig.at.copy(), rig.t
        ways = []
        for _ in range(2):
            rig.hashes, rig.t = [], time
            rig.at[...] = at
            rig.move((1e-3, 0.0, 2e-3), 0.05)
            ways.append(rig.hashes)
            rig.engine.restore(saved)
        assert ways[0] == ways[1]
        with pytest.raises(StateError, match="was it saved elsewhere"):
            rig.engine.restore(saved[:-8])


@pytest.mark.parametrize("speed", [3.0, 30.0, 100.0])
def test_a_sphere_shot_through_ends_with_a_word_or_not_at_all(speed):
    """The speed of sound in this tissue is 5 m/s."""
    with FemRig(params({**BLOCK, "nodes": 75}), start=(0.0, 0.0, 0.03)) as rig, suppress(SessionError):
        rig.follow(
            lambda t: (np.array([1e-3, 0.0, 0.03 - speed * t]), np.array([0.0, 0.0, -speed])), 0.06 / speed
        )
        rig.follow(lambda t: (np.array([0.0, 0.0, 0.1]), np.zeros(3)), 0.1)
    assert np.isfinite(rig.wrenches).all()


class Jaw:
    """Two fingers of three spheres that point down, apart along x."""

    def __init__(self, organ=None, **grasp):
        slab = {"size": ["60 mm", "40 mm", "12 mm"], "young_modulus": "10 kPa", "nodes": 150} | (organ or {})
        probe = {"spheres": 6, "radius": "2 mm", "grasp": grasp}
        self.engine = FemEngine("tissue", params(slab, probe, node_period="1 ms"))
        self.outputs = dict(self.engine.configure(Setup(MS, Path(), {"probe": IMPULSE})))
        self.t, self.events, self.tissue_events = 0, [], []

    def spheres(self, height, opening):
        return np.array(
            [[side * opening, 3e-3 * i, height] for side in (-1, 1) for i in (-1, 0, 1)], dtype=np.float64
        )

    def go(self, start, end, seconds=0.1):
        """Move from one height and opening (m) to another."""
        steps = round(seconds * 1e3)
        one, other = self.spheres(*start), self.spheres(*end)
        for i in range(steps):
            place, velocity = one + (other - one) * i / steps, (other - one) / seconds
            inputs = Inputs({"probe/position": place.ravel(), "probe/velocity": velocity.ravel()})
            self.outputs |= self.engine.step(self.t, MS, inputs)
            self.t += MS
            self.events += [event.event for event in self.outputs["probe/events"]]
            self.tissue_events += self.outputs.get("block/events", ())
        return self

    def take(self):
        return self.go((3e-3, 5e-3), ON_SLAB).go(ON_SLAB, CLOSED, 0.2)


ON_SLAB, CLOSED, LIFTED = (0.5e-3, 5e-3), (0.5e-3, 2e-3), (4.5e-3, 2e-3)
"""Height and half of the opening, m."""


def test_fingers_take_tissue_lift_it_and_let_go():
    jaw = Jaw().take()
    assert jaw.events == ["grasped"]
    before = jaw.outputs["probe/lift"][0]
    jaw.go(CLOSED, LIFTED)
    assert jaw.outputs["probe/lift"][0] - before == pytest.approx(4e-3, rel=0.02)
    felt = jaw.outputs["probe/force"].reshape(6, 3).sum(axis=0)
    assert 0.1 < -felt[2] < 3.0
    np.testing.assert_allclose(jaw.outputs["probe/pull"], -felt, rtol=0.05, atol=5e-3)
    jaw.go(LIFTED, (4.5e-3, 6e-3))
    assert jaw.events == ["grasped", "released"]
    jaw.go((8e-3, 6e-3), (8e-3, 6e-3), 0.3)
    assert np.abs(jaw.engine._organs[0].solid.displacement[:, :3]).max() < 5e-4


def test_with_a_width_the_held_spheres_yield_by_what_the_mesh_lacks():
    raised, pulls = (1.5e-3, 2e-3), []
    for width in ({}, {"width": "4 mm"}):
        jaw = Jaw(**width).take().go(CLOSED, CLOSED, 0.1)
        before = jaw.outputs["probe/pull"][2]
        jaw.go(CLOSED, raised).go(raised, raised)
        pulls.append(jaw.outputs["probe/pull"][2] - before)
        jaw.go(raised, raised, 0.05)
        assert jaw.outputs["probe/pull"][2] - before == pytest.approx(pulls[-1], rel=0.01)
    grasp = jaw.engine._grasps[0][0]
    (hold,), surface, lift = grasp._holds, grasp._surfaces["block"], 1e-3
    missing = patch_at(surface.compliance, surface.material, hold.nodes, 4e-3).missing[2, 2]
    assert missing * pulls[1] > 0.5 * lift
    assert lift / pulls[1] - lift / pulls[0] == pytest.approx(missing, rel=0.1)


def test_a_state_with_held_tissue_goes_on_as_it_would_have():
    jaw, ends = Jaw().take(), []
    saved, time = jaw.engine.save(), jaw.t
    jaw.go(CLOSED, (8e-3, 6e-3))
    for _ in range(2):
        jaw.engine.restore(saved)
        jaw.t = time
        ends.append((jaw.go(CLOSED, LIFTED).engine.save(), jaw.outputs["probe/lift"][0]))
    assert ends[0] == ends[1]
    assert ends[0][1] > 1e-3


def test_tissue_slides_off_an_instrument_that_is_taken_out_of_the_arm_in_an_exchange():
    jaw = Jaw().take().go(CLOSED, LIFTED)
    away = jaw.spheres(*LIFTED) + np.array([0.0, 0.0, 1000.0])
    inputs = Inputs({"probe/position": away.ravel(), "probe/velocity": np.zeros(18)})
    jaw.outputs |= jaw.engine.step(jaw.t, MS, inputs)
    (event,) = jaw.outputs["probe/events"]
    assert (event.event, event.body) == ("exchanged while holding", "block")
    assert event.force_n > 0.1
    assert jaw.outputs["probe/held"][0] == 0.0
    jaw.t += MS
    jaw.go((1000.0, 5e-3), (1000.0, 5e-3), 0.3)
    assert np.abs(jaw.engine._organs[0].solid.displacement[:, :3]).max() < 5e-4


def test_tissue_that_is_pulled_too_hard_tears_loose():
    jaw = Jaw(hold="0.3 N")
    jaw.go((3e-3, 5e-3), (0.5e-3, 5e-3)).go((0.5e-3, 5e-3), (0.5e-3, 2e-3), 0.2).go(
        (0.5e-3, 2e-3), (12e-3, 2e-3)
    )
    assert jaw.events == ["grasped", "torn"]


def test_it_keeps_the_contract_of_engines():
    model = params({**BLOCK, "nodes": 75})
    inputs = {"probe/pose": [0, 0, 5.2e-3, 0, 0, 0, 1], "probe/twist": [0.001, 0, -0.02, 0, 0, 0]}
    check_engine(lambda: FemEngine("tissue", model), period_ns=4 * MS, inputs=inputs)


def test_an_unfit_node_period_is_refused():
    with pytest.raises(ScenarioError, match="node_period"):
        FemEngine("tissue", params(node_period="1.5 ms")).configure(Setup(MS, Path(), {}))


def test_parameters_are_those_of_bullet_but_for_its_own():
    shared = FemParams.model_fields.keys()
    assert BulletParams.model_fields.keys() - shared == {"standstill"}


@pytest.mark.long
def test_a_palpation_with_it_is_recorded_and_verified(tmp_path):
    recording = str(tmp_path / "press")
    options = ["--set", "participants.tissue.kind=fem", "--set", "duration=1.2 s", "--record", recording]
    command_line("run", "palpation", "--json", *options)
    assert command_line("verify", recording, "--json")["same"]


def command_line(*arguments):
    """Return what a command answers in JSON."""
    command = [sys.executable, "-P", "-m", "hub.command_line", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
    return json.loads(done.stdout)
