"""Organs on rigid boxes: weight, friction, walls, and the same bits again."""

from pathlib import Path

import numpy as np
import pytest

from engines.fem.engine import FemEngine
from engines.fem.params import FemParams
from hub.participant import Inputs, Setup
from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from hub.verify import verify
from schemas.errors import SessionError
from tests.engines.fem.rig import MS, FemRig, params

LOOSE = {"size": ["40 mm", "30 mm", "16 mm"], "young_modulus": "10 kPa", "nodes": 120, "anchors": []}
BED = {"box": ["200 mm", "200 mm", "20 mm"], "position": [0, 0, "-27 mm"]}
TOP = -17e-3


def engine_of(organs, **rest):
    engine = FemEngine("tissue", FemParams.model_validate({"organs": organs, "probes": {}, **rest}))
    engine.configure(Setup(MS, Path(), {}))
    return engine


def run(engine, milliseconds, start=0):
    """Return the force on the first box by step, N, shape (steps, 3)."""
    found = []
    for i in range(start, start + milliseconds):
        engine.step(i * MS, MS, Inputs({}))
        found.append(engine._organs[0].solid.support[0].copy())
    return np.array(found)


def test_a_block_on_a_bed_comes_to_rest_with_its_weight():
    with engine_of({"block": LOOSE}, rigid={"bed": BED}) as engine:
        force = run(engine, 300)
        solid = engine._organs[0].solid
    weight = solid.mass.sum() * 9.80665
    assert force[-100:].mean(axis=0) == pytest.approx([0.0, 0.0, -weight], rel=1e-3, abs=1e-3 * weight)
    assert np.abs(solid.velocity[:, :3]).max() < 1e-3
    assert solid.nodes[:, 2].min() == pytest.approx(TOP, abs=2e-6)
    assert solid.nodes[:, 2].max() == pytest.approx(TOP + 16e-3, abs=5e-4)


def slope(degrees, friction):
    """A block on an incline that falls towards +x."""
    angle = np.radians(degrees)
    turned = [0.0, float(np.sin(0.5 * angle)), 0.0, float(np.cos(0.5 * angle))]
    up = np.array([np.sin(angle), 0.0, np.cos(angle)])
    block = {**LOOSE, "position": (16e-3 * up).tolist(), "orientation": turned}
    board = {"box": [1.0, 1.0, 0.02], "position": (-0.01 * up).tolist(), "orientation": turned}
    return engine_of({"block": block}, rigid={"board": {**board, "friction": friction}})


def test_below_the_angle_of_friction_a_block_stays_and_beyond_it_slides():
    friction, ways = 0.4, {}  # 21.8 degrees
    for degrees in (18.0, 26.0):
        with slope(degrees, friction) as engine:
            run(engine, 200)
            solid = engine._organs[0].solid
            start = (solid.mass[:, None] * solid.velocity[:, :3]).sum(axis=0) / solid.mass.sum()
            before = solid.nodes.mean(axis=0)
            run(engine, 200, 200)
            angle = np.radians(degrees)
            down = np.array([np.cos(angle), 0.0, -np.sin(angle)])
            ways[degrees] = float((solid.nodes.mean(axis=0) - before) @ down), float(start @ down)
    assert abs(ways[18.0][0]) < 1e-5
    angle, (way, speed) = np.radians(26.0), ways[26.0]
    falls = 9.80665 * (np.sin(angle) - friction * np.cos(angle))
    assert way == pytest.approx(0.2 * speed + 0.5 * falls * 0.2**2, rel=0.03)


def test_tissue_pressed_into_a_corner_of_boxes_enters_none():
    walls = {"bed": BED, "wall": {"box": ["20 mm", "1 m", "1 m"], "position": ["31 mm", 0, 0]}}
    block = {**LOOSE, "anchors": [{"surface": "left"}]}
    with FemRig(params(block, rigid=walls), start=(0.0, 0.0, 7e-3)) as rig:
        rig.move((10e-3, 0.0, 0.0), 0.2)
        rig.hold(0.1)
        solid = rig.engine._organs[0].solid
        assert rig.force[2] > 0.1
        assert solid.nodes[:, 2].min() > TOP - 2e-5
        assert solid.nodes[:, 0].max() < 21e-3 + 2e-5
        assert solid.support[0, 2] < -0.1
        assert solid.support[1, 0] > 0.0


def test_tissue_that_begins_inside_a_box_comes_out_slowly():
    """A box stands through the tied block."""
    wall = {"box": ["4 mm", "10 mm", "1 m"], "position": ["5 mm", 0, 0]}
    with engine_of({"block": {**LOOSE, "anchors": [{"surface": "bottom"}]}}, rigid={"wall": wall}) as engine:
        run(engine, 100)
        assert np.abs(engine._organs[0].solid.velocity[:, :3]).max() < 0.2


def test_a_block_with_nothing_under_it_falls_and_the_sentence_says_so():
    with (
        engine_of(
            {"loose": LOOSE}, rigid={"aside": {"box": [0.01, 0.01, 0.01], "position": [1, 0, 0]}}
        ) as engine,
        pytest.raises(SessionError, match=r"organ 'loose'.*it fell: nothing anchors it"),
    ):
        run(engine, 500)


def test_a_force_of_the_mesh_alone_is_said(caplog):
    model = params(LOOSE, rigid={"bench": BED})
    with FemRig(model):
        assert [record.getMessage().count("may lean on bench") for record in caplog.records] == [1]
    tied = params({**LOOSE, "anchors": [{"surface": "bottom", "to": "bench"}]}, rigid={"bench": BED})
    assert tied.has_sub_grid("probe")
    assert not model.has_sub_grid("probe")


def test_a_sliding_block_is_saved_and_restored_to_the_bit():
    with slope(30.0, 0.3) as engine:
        run(engine, 40)
        saved, ends = engine.save(), []
        for _ in range(2):
            engine.restore(saved)
            run(engine, 40, 40)
            ends.append(engine.save())
        assert ends[0] == ends[1] != saved


SESSION = """\
name: bed
step: 1 ms
duration: 48 ms
participants:
  tissue:
    kind: fem
    HOST
    probes: {}
    rigid: {bed: {box: [200 mm, 200 mm, 20 mm], position: [0, 0, -27 mm]}}
    organs:
      block: {size: [40 mm, 30 mm, 16 mm], young_modulus: 10 kPa, nodes: 75, anchors: []}
      on_top:
        {size: [20 mm, 16 mm, 8 mm], young_modulus: 10 kPa, nodes: 75, position: [0, 2 mm, 9 mm], anchors: []}
"""


@pytest.mark.long
def test_a_session_of_a_pile_in_one_process_and_in_two_has_the_same_bits(tmp_path):
    hashes = []
    for host in ("host: hub", "host: elsewhere"):
        (tmp_path / "bed.yaml").write_text(SESSION.replace("HOST", host))
        folder = tmp_path / host[-3:]
        launch(load(str(tmp_path / "bed.yaml")), record=folder).run()
        summary = verify(Recording(folder))
        assert (summary.same, summary.steps) == (True, 48)
        acks = Recording(folder).acks("tissue")
        hashes.append(np.concatenate([ack.state_hash for ack in acks]).tolist())
    assert hashes[0] == hashes[1]
