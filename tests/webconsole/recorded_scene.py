"""A recording with a robot that moves and an organ that gives, made of formulas: no engine has stepped."""

import json
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image

from hub.planning.scenario_file import load
from hub.recording.recorder import Recorder
from hub.session.launch import plan_of
from schemas.codec import encode
from schemas.keys import Keys, topic
from schemas.ros import CompressedImage, Header, Time
from schemas.scenario import Connection, ParticipantSpec
from schemas.trocar_msgs import SessionStatus, ShownMarkers, SoftBodyState
from schemas.vectors import VectorCodec
from schemas.visualization import MarkerType

STEP_NS = 16_000_000
CUBE = 0.02 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-2, 0)], np.float32)
TRIANGLES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ],
    np.uint32,
)

EYES = {"left": (200, 40, 90), "right": (30, 150, 220)}
"""Colour (red, green, blue) of the picture of each eye."""
SIZES = {
    MarkerType.ARROW: [0.006, 0.001, 0.001],
    MarkerType.ARROW_STRIP: [0.001, 0.002, 0.002],
    MarkerType.LINE_STRIP: [0.001, 0, 0],
    MarkerType.LINE_LIST: [0.001, 0, 0],
    MarkerType.CUBE_LIST: [0.002] * 3,
    MarkerType.SPHERE_LIST: [0.002] * 3,
    MarkerType.POINTS: [0.001, 0.001, 0],
    MarkerType.TEXT_VIEW_FACING: [0, 0, 0.004],
    MarkerType.TRIANGLE_LIST: [1, 1, 1],
    MarkerType.MESH_RESOURCE: [0.1] * 3,
}
"""Of markers, m, where it is not 5 mm."""


def write_scene(directory: Path, steps: int = 60, *, pictures: bool = True) -> None:
    """Record `palpation` with an arm that goes down by 1 mm a step from the fifth, and a top that follows.

    A page leads the arm, and the force of the block is on its instrument. An endoscope has published one
    picture of each eye. Markers of every type are shown for the first half.
    """
    file = load("palpation", [])
    plan, _ = plan_of(file.scenario, file.params)
    robot, tissue, keys = plan.participants["robot"], plan.participants["tissue"], Keys("palpation")
    qpos, tip, pose = (
        VectorCodec(robot.port(name)) for name in ("qpos", "PSM1/tip_wrench", "PSM1/probe/pose")
    )
    wrench = VectorCodec(tissue.port("probe/wrench"))
    led = file.scenario.participants | {"hand": ParticipantSpec(kind="browser", host="remote")}
    connections = [*file.scenario.connections, Connection.model_validate("hand.pose -> teleop.master")]
    scenario = file.scenario.model_copy(update={"participants": led, "connections": connections})
    attachments = {
        "origin.json": json.dumps({"directory": str(directory.parent)}).encode(),
        "scenario.json": scenario.model_dump_json().encode(),
        "plan.json": plan.model_dump_json().encode(),
    }
    with Recorder(directory, attachments=attachments) as recorder:
        channels = {
            name: recorder.add_channel(topic(keys.output("engine", *name.split(".", 1))), type_)
            for name, type_ in (
                ("robot.qpos", qpos.port.type),
                ("robot.PSM1/tip_wrench", tip.port.type),
                ("robot.PSM1/probe/pose", pose.port.type),
                ("tissue.probe/wrench", wrench.port.type),
                ("tissue.block/nodes", SoftBodyState.ros_type),
            )
        }
        for eye, colour in EYES.items() if pictures else ():
            image = recorder.add_channel(
                topic(keys.output("engine", "endoscope", f"{eye}/image_raw/compressed")),
                CompressedImage.ros_type,
            )
            recorder.write(image, 0, encode(_picture(colour)))
        shown = recorder.add_channel(topic(keys.output("engine", "markers", "shown")), ShownMarkers.ros_type)
        status = recorder.add_channel(topic(keys.status), SessionStatus.ros_type)
        for step in range(steps):
            stamp = Header(stamp=Time.from_ns(step * STEP_NS), frame_id="world")
            recorder.write(shown, step * STEP_NS, encode(markers(stamp, none=2 * step >= steps)))
            at, depth = step * STEP_NS, 0.001 * max(step - 5, 0)
            positions = np.zeros(qpos.size)
            positions[2] = 0.1 + depth
            recorder.write(channels["robot.qpos"], at, qpos.encode(positions, at))
            force = np.array([0, 0, 50 * depth, 0, 0, 0])
            recorder.write(channels["tissue.probe/wrench"], at, wrench.encode(force, at))
            recorder.write(channels["robot.PSM1/tip_wrench"], at, tip.encode(force, at))
            place = np.array([0, 0, -depth, 0, 0, 0, 1])
            recorder.write(channels["robot.PSM1/probe/pose"], at, pose.encode(place, at))
            nodes = CUBE - np.array([0, 0, depth], np.float32) * (CUBE[:, 2:] >= 0)
            state = SoftBodyState(
                header=Header(stamp=Time.from_ns(at), frame_id="world"),
                body="block",
                nodes_m=nodes.astype(np.float32).ravel(),
                triangles=TRIANGLES.ravel() if step == 0 else np.zeros(0, np.uint32),
            )
            recorder.write(channels["tissue.block/nodes"], at, encode(state))
        end = SessionStatus(
            session="palpation",
            run=1,
            state="done",
            step=steps,
            sim_time_ns=steps * STEP_NS,
            real_time_factor=1.0,
            late_steps=0,
            dropped_messages=0,
        )
        recorder.write(status, steps * STEP_NS, encode(end))


def markers(header: Header, *, none: bool = False) -> ShownMarkers:
    """Return one marker of each type, beside the block, and a text that a camera carries; or none."""
    if none:
        return ShownMarkers(header=header)
    types = [*MarkerType, MarkerType.TEXT_VIEW_FACING]
    texts = {MarkerType.TEXT_VIEW_FACING: "Cut here", MarkerType.MESH_RESOURCE: "PSM1/roll"}
    lists = {
        kind: 3 for kind in MarkerType if kind.name.endswith(("_LIST", "_STRIP")) or kind is MarkerType.POINTS
    }
    lists[MarkerType.LINE_LIST] = 4
    counts = [lists.get(kind, 0) for kind in types]
    triangle = 0.005 * np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1], [1, 0, 1]])
    count = len(types)
    at = [[0.03 + 0.008 * (i % 4), -0.02, 0.008 * (i // 4), 0, 0, 0, 1] for i in range(count)]
    return ShownMarkers(
        header=header,
        namespaces=[""] * count,
        ids=np.arange(count, dtype=np.int32),
        types=np.array(types, np.uint8),
        frames=["world"] * (count - 1) + ["endoscope_left_optical"],
        poses=np.array(at).ravel(),
        scales_m=np.concatenate([SIZES.get(kind, [0.005] * 3) for kind in types]),
        colors=np.tile(np.array([1, 0, 1, 1], np.float32), count),
        expires_ns=np.zeros(count, np.uint64),
        texts=[texts.get(kind, "") for kind in types[:-1]] + ["Insert the needle"],
        point_counts=np.array(counts, np.uint32),
        points_m=np.concatenate([triangle[:n].ravel() for n in counts]),
        color_counts=np.zeros(count, np.uint32),
        point_colors=np.zeros(0, np.float32),
    )


def _picture(colour: tuple[int, int, int]) -> CompressedImage:
    png = BytesIO()
    Image.new("RGB", (32, 24), colour).save(png, "png")
    return CompressedImage(header={}, format="png", data=np.frombuffer(png.getvalue(), np.uint8))
