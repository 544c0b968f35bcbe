"""A recording of a block that is cut open, made by hand: no engine has stepped."""

import json
from pathlib import Path

import numpy as np

from hub.planning.scenario_file import load
from hub.recording.recorder import Recorder
from hub.session.launch import plan_of
from schemas.codec import encode
from schemas.keys import Keys, topic
from schemas.ros import Header, Time
from schemas.soft_surface import FaceKind
from schemas.trocar_msgs import SoftBodyState, SurfaceChange, SurfaceFilm
from schemas.vectors import VectorCodec
from tests.engines.tissue.cut_block import CutBlock

STEP_NS = 16_000_000
STEPS, CUT_AT = 30, 10


def nodes_at(block: CutBlock, step: int) -> SoftBodyState:
    gap = 0.01 if step >= CUT_AT else 0.0
    triangles = block.mesh.triangles if step == 0 else np.zeros((0, 3))
    return SoftBodyState(
        header=Header(stamp=Time.from_ns(step * STEP_NS), frame_id="world"),
        body="block",
        nodes_m=block.part(gap).astype(np.float32).ravel(),
        triangles=triangles.astype(np.uint32).ravel(),
    )


def film_at(block: CutBlock, step: int) -> SurfaceFilm:
    """Return blood on all nodes of the cut block, none before."""
    nodes = np.arange(len(block.part(0.0)) if step >= CUT_AT else 0)
    return SurfaceFilm(
        header=Header(stamp=Time.from_ns(step * STEP_NS), frame_id="world"),
        body="block",
        liquid="blood",
        nodes=nodes.astype(np.uint32),
        thickness=np.full(len(nodes), 60, np.uint8),
    )


def write_cut(directory: Path, *overrides: str) -> CutBlock:
    """Record the block of `palpation`, cut open in the middle of the recording, and burnt beside the cut."""
    file = load("palpation", overrides)
    plan, _ = plan_of(file.scenario, file.params)
    keys, qpos = Keys("palpation"), VectorCodec(plan.participants["robot"].port("qpos"))
    attachments = {
        "origin.json": json.dumps({"directory": str(directory.parent)}).encode(),
        "scenario.json": file.scenario.model_dump_json().encode(),
        "plan.json": plan.model_dump_json().encode(),
    }
    block = CutBlock(np.array([0.08, 0.06, 0.02]), 250)
    with Recorder(directory, attachments=attachments) as recorder:
        channels = {
            name: recorder.add_channel(topic(keys.output("engine", *name.split(".", 1))), type_)
            for name, type_ in (
                ("robot.qpos", qpos.port.type),
                ("tissue.block/nodes", SoftBodyState.ros_type),
                ("tissue.block/surface", SurfaceChange.ros_type),
                ("tissue.block/film", SurfaceFilm.ros_type),
            )
        }
        for step in range(STEPS):
            at = step * STEP_NS
            if step == CUT_AT:
                block.cut(0.012)
                block.surface.replace(np.array([0]), block.surface.faces[:1], np.array([FaceKind.CHARRED]))
            recorder.write(channels["robot.qpos"], at, qpos.encode(np.zeros(qpos.size), at))
            recorder.write(channels["tissue.block/nodes"], at, encode(nodes_at(block, step)))
            recorder.write(channels["tissue.block/surface"], at, encode(block.surface.change("block", at)))
            recorder.write(channels["tissue.block/film"], at, encode(film_at(block, step)))
    return block
