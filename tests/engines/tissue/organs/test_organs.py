"""Organs in Bullet: what holds them, several at once, and that their runs repeat."""

from pathlib import Path

import numpy as np
import pytest

from engines.bullet.engine import BulletEngine
from engines.bullet.params import BulletParams
from engines.tissue.meshing.grid import block
from engines.tissue.meshing.tet_mesh import TetMesh
from hub.participant import Inputs, Setup
from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from hub.verify import verify
from schemas.errors import ScenarioError, SessionError
from tests.engines.bullet.rig import MS, SMALL_BLOCK

# its top is at z = -25 mm
BED = {"bed": {"box": ["200 mm", "200 mm", "20 mm"], "position": [0, 0, "-35 mm"]}}


def engine_of(organs, **rest):
    engine = BulletEngine("tissue", BulletParams.model_validate({"organs": organs, "probes": {}, **rest}))
    engine.configure(Setup(MS, Path(), {}))
    return engine


def nodes_after(engine, milliseconds, name):
    """Return the nodes of an organ, shape (n, 3), m; `milliseconds` is a multiple of 16."""
    outputs = {}
    for i in range(milliseconds):
        outputs |= engine.step(i * MS, MS, Inputs({}))
    return outputs[f"{name}/nodes"].nodes_m.astype(float).reshape(-1, 3)


@pytest.mark.parametrize(
    ("shape", "farthest"), [("kidney-with-adrenal", 0.03), ("colon", 0.01), ("liver-lobe", 0.03)]
)
def test_every_organ_comes_to_rest_on_its_own_anchors(shape, farthest):
    with engine_of({"organ": {"shape": shape, "nodes": 150}}) as engine:
        organ = engine.params.organs["organ"]
        first = nodes_after(engine, 16, "organ")
        later = nodes_after(engine, 48, "organ")
    (tied,) = organ.anchored_nodes.values()
    np.testing.assert_allclose(later[tied], organ.rest.nodes[tied], atol=1e-7)
    assert 1e-4 < np.abs(later - organ.rest.nodes).max() < farthest
    assert np.abs(later - first).max() < 3e-4


def test_an_organ_may_lie_freely_on_a_bed_or_be_tied_to_it():
    with engine_of(
        {"free": {**SMALL_BLOCK, "position": [0, 0, "-4 mm"], "anchors": []}}, rigid=BED
    ) as engine:
        nodes = nodes_after(engine, 160, "free")
        assert -0.026 < nodes[:, 2].min() < -0.024
        assert np.abs(nodes[:, :2].mean(axis=0)).max() < 1e-3
    hung = {**SMALL_BLOCK, "position": [0, 0, "-45 mm"], "anchors": [{"surface": "top", "to": "bed"}]}
    with engine_of({"hung": hung}, rigid=BED) as engine:
        nodes = nodes_after(engine, 160, "hung")
        tied = engine.params.organs["hung"].anchored_nodes["bed"]
        assert nodes[tied][:, 2] == pytest.approx(-0.045, abs=2e-4)
        assert nodes[:, 2].min() < -0.065


def test_organs_touch_one_another():
    small = {**SMALL_BLOCK, "size": ["40 mm", "30 mm", "20 mm"], "position": [0, 0, "22 mm"], "anchors": []}
    with engine_of({"under": SMALL_BLOCK, "on_top": small}) as engine:
        nodes = nodes_after(engine, 160, "on_top")
    assert -3e-3 < nodes[:, 2].min() < 0  # the one under it gives way


def test_an_organ_that_falls_out_of_the_scene_ends_the_session_and_is_named():
    with (
        pytest.raises(SessionError, match=r"organ 'loose'.*it fell: nothing anchors it"),
        engine_of({"loose": {**SMALL_BLOCK, "anchors": []}}),
    ):
        pass


def hashes(engine, steps=64):
    found = []
    for i in range(steps):
        engine.step(i * MS, MS, Inputs({}))
        found.append(engine.state_hash())
    return found


@pytest.mark.long
def test_several_organs_in_several_engines_repeat_bit_for_bit():
    organs = {
        "kidney": {"shape": "kidney-with-adrenal", "nodes": 150},
        "block": {**SMALL_BLOCK, "position": ["200 mm", 0, 0], "orientation": [0, 0, 0.6, 0.8]},
    }
    other = {"liver": {"shape": "liver-lobe", "nodes": 150}}
    with engine_of(organs) as one, engine_of(other) as two:
        assert [port.name for port in one.ports] == ["kidney/nodes", "block/nodes"]
        interleaved = [
            (
                one.step(i * MS, MS, Inputs({})),
                two.step(i * MS, MS, Inputs({})),
                one.state_hash(),
                two.state_hash(),
            )[2:]
            for i in range(64)
        ]
    with engine_of(other) as two, engine_of(organs) as one:
        assert list(zip(hashes(one), hashes(two), strict=True)) == interleaved
    assert len(set(interleaved)) > 4


def test_an_organ_is_the_same_beside_another_and_alone():
    kidney = {"shape": "kidney-with-adrenal", "nodes": 150}
    with (
        engine_of({"kidney": kidney}) as alone,
        engine_of({"kidney": kidney, "block": {**SMALL_BLOCK, "position": ["300 mm", 0, 0]}}) as beside,
    ):
        np.testing.assert_allclose(
            nodes_after(alone, 64, "kidney"), nodes_after(beside, 64, "kidney"), atol=1e-5
        )


SESSION = """\
name: tissues
step: 1 ms
duration: 32 ms
participants:
  here:
    kind: bullet
    probes: {}
    organs: {liver: {mesh: data/liver.vtk, unit: mm, material: liver, anchors: [{surface: top}]}}
  there:
    kind: bullet
    host: tissue
    probes: {}
    rigid: {bed: {box: [1, 1, 10 mm], position: [0, 0, -40 mm]}}
    organs:
      kidney: {shape: kidney-with-adrenal, nodes: 120}
      block:
        size: [30 mm, 30 mm, 20 mm]
        material: kidney
        nodes: 45
        position: [150 mm, 0, -14 mm]
        anchors: [{surface: bottom, to: bed}]
"""


def written(directory, mesh):
    (directory / "data").mkdir()
    mesh.write_vtk(directory / "data" / "liver.vtk")
    (directory / "session.yaml").write_text(SESSION)
    return load(str(directory / "session.yaml"))


@pytest.mark.long
def test_a_session_with_two_tissue_engines_and_a_mesh_of_ones_own_is_re_simulated_bit_for_bit(tmp_path):
    mesh = block(np.array([40.0, 30.0, 20.0]), 45)
    launch(written(tmp_path, mesh), record=tmp_path / "recording").run()
    recording = Recording(tmp_path / "recording")
    summary = verify(recording)
    assert (summary.same, summary.steps) == (True, 32)


def test_a_bad_mesh_is_shown_where_the_scenario_names_it(tmp_path):
    mesh = block(np.array([40.0, 30.0, 20.0]), 45)
    inverted = TetMesh(mesh.nodes, np.concatenate([mesh.tetrahedra[:1, [1, 0, 2, 3]], mesh.tetrahedra[1:]]))
    with pytest.raises(ScenarioError, match=r"session\.yaml:8:.*liver.*1 of \d+ tetrahedra are inverted: 0"):
        launch(written(tmp_path, inverted))
