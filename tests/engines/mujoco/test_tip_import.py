"""A jaw of a URDF or MJCF model in place of an instrument's jaw."""

import re
import struct
from math import cos, radians, sin

import numpy as np
import pytest
from typer.testing import CliRunner

import trocar
from engines.mujoco import looks
from engines.mujoco.instrument_commands import app
from engines.mujoco.params import SceneParams
from engines.mujoco.tip_import import import_tip
from robots.dvrk.end_effectors.own_jaw import JawFile
from schemas.errors import ScenarioError, TrustError
from schemas.files import Files

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6],
     [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip
LENGTH = 0.020
APART = radians(10.0)


def box(side, low=0.001):
    """Return the triangles of a finger beside the plane x = 0, shape (12, 3, 3), m."""
    corners = CORNERS * [side * 0.002, 0.004, LENGTH - low] + [0.0, -0.002, low]
    return corners[FACES if side > 0 else FACES[:, ::-1]]


def write_stl(path, triangles):
    rows = b"".join(struct.pack("<12fH", 0, 0, 0, *corners.ravel(), 0) for corners in triangles)
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(b"\0" * 80 + struct.pack("<I", len(triangles)) + rows)


def link(name, scale=1.0):
    return (
        f'<link name="{name}"><inertial><mass value="2e-4"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0"'
        f' iyz="0"/></inertial><visual><geometry><mesh filename="package://tool/meshes/{name}.stl"'
        f' scale="{scale} {scale} {scale}"/></geometry></visual></link>'
    )


def joint(child, axis, turn=0.0, kind="revolute", parent="wrist", limit='lower="-0.1" upper="0.5"'):
    return (
        f'<joint name="{child}_joint" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0.1 0" rpy="0 {turn} 0"/><axis xyz="{axis}"/>'
        f'<limit {limit} effort="1" velocity="1"/></joint>'
    )


def model(tmp_path, *, scale=1.0, kind="revolute", apart=APART, extra=""):
    """Write a ROS package: an arm without its mesh, and a tool whose fingers are `apart` (rad) at 0."""
    for name, side in (("left", 1), ("right", -1)):
        write_stl(tmp_path / "meshes" / f"{name}.stl", box(side))
    text = (
        f'<robot name="tool"><link name="base"/>{link("arm")}<link name="wrist"/>{link("left", scale)}'
        f"{link('right', scale)}{joint('arm', '0 0 1', parent='base')}"
        f'<joint name="w" type="fixed"><parent link="arm"/><child link="wrist"/></joint>'
        f"{joint('left', '0 1 0', apart, kind)}{joint('right', '0 -1 0', 0.0, kind)}{extra}</robot>"
    )
    file = tmp_path / "urdf" / "tool.urdf"
    file.parent.mkdir(exist_ok=True)
    file.write_text(text)
    return file


def test_a_jaw_of_a_whole_arm_is_found_and_closed(tmp_path):
    tip = import_tip(model(tmp_path), name="own")
    assert tip.file.length == pytest.approx(np.hypot(LENGTH, 0.002), abs=1e-5)
    assert tip.file.opening == pytest.approx(1.0 + radians(10.0))  # 0.5 rad each, from 10 degrees apart
    assert tip.file.left.mass == pytest.approx(2e-4)
    assert "closed where the pads meet: 10.0 degrees" in "; ".join(tip.report)
    left, right = (finger.triangles[0] for finger in (tip.file.left, tip.file.right))
    assert (left[:, 0].min(), left[:, 0].max()) == pytest.approx((0.0, 0.002), abs=1e-5)
    assert (right[:, 0].min(), right[:, 0].max()) == pytest.approx((-0.002, 0.0), abs=1e-5)
    assert (left[:, 1].min(), right[:, 1].max()) == pytest.approx((-0.002, 0.002), abs=1e-5)
    assert JawFile.model_validate(tip.file.model_dump()).left.triangles[1].shape == (12, 3)


@pytest.mark.parametrize("apart", [0.0, radians(120.0)])
def test_the_zero_of_the_model_is_anywhere(tmp_path, apart):
    one, other = (import_tip(model(tmp_path, apart=angle), name="own").file for angle in (APART, apart))
    assert np.allclose(one.left.triangles[0], other.left.triangles[0], atol=2e-6)
    assert np.allclose(one.right.triangles[0], other.right.triangles[0], atol=2e-6)


def test_mjcf_gives_the_same_jaw(tmp_path):
    urdf = import_tip(model(tmp_path), name="own")
    half = radians(5.0)
    fingers = "".join(
        f'<body name="{name}" pos="0 0.1 0" quat="{cos(turn)} 0 {sin(turn)} 0"><joint axis="0 {side} 0"'
        f' range="-0.1 0.5"/><geom type="mesh" mesh="{name}" mass="2e-4"/></body>'
        for name, side, turn in (("left", 1, half), ("right", -1, 0.0))
    )
    file = tmp_path / "tool.xml"
    file.write_text(
        '<mujoco><compiler angle="radian" meshdir="meshes"/><asset><mesh name="left" file="left.stl"/>'
        f'<mesh name="right" file="right.stl"/></asset><worldbody><body>{fingers}</body></worldbody></mujoco>'
    )
    mjcf = import_tip(file, name="own")
    assert mjcf.file.opening == pytest.approx(urdf.file.opening)
    for one, other in ((mjcf.file.left, urdf.file.left), (mjcf.file.right, urdf.file.right)):
        assert {tuple(row) for row in np.round(one.triangles[0], 5).tolist()} == {
            tuple(row) for row in np.round(other.triangles[0], 5).tolist()
        }


@pytest.mark.long
def test_a_session_has_the_jaw_and_verifies(tmp_path):
    done = CliRunner().invoke(
        app, ["import", str(model(tmp_path)), "-o", str(tmp_path / "own-tip.yaml"), "--opening", "50"]
    )
    assert done.exit_code == 0, done.output
    assert "tip: " in done.output
    scenario = tmp_path / "press.yaml"
    scenario.write_text("""
name: press
step: 1 ms
duration: 100 ms
scene:
  arms:
    PSM1: {instrument: "400006", tip: own-tip.yaml, jaw: 30 deg, position: [0 mm, 0 mm, 131 mm], touches: [b]}
participants:
  routine:
    kind: routine
    steps:
      - {do: move_cp, arm: PSM1, position: [0 mm, 0 mm, -118 mm], orientation: [0.70710678, 0.70710678, 0, 0]}
  motion: {kind: motion, initial_state: homed, reference: base}
  robot: {kind: mujoco}
  tissue:
    kind: bullet
    organs: {b: {size: [60 mm, 60 mm, 15 mm], young_modulus: 5 kPa}}
order: [routine, motion, robot]
connections:
  - routine.* -> motion.*
  - motion.* -> routine.*
  - motion.drive/* -> robot.*
  - robot.* -> motion.sense/*
""")
    record = tmp_path / "record"
    trocar.run(scenario, record=record)
    jaw = trocar.Recording(record)["robot.PSM1/jaw/measured_js"]["position"]
    assert jaw[-1, 0] == pytest.approx(radians(30.0), abs=0.02)
    assert trocar.verify(record).same
    (tmp_path / "own-tip.yaml").write_text((tmp_path / "own-tip.yaml").read_text() + "\n")
    with pytest.raises(TrustError, match=r"own-tip.yaml', which is missing or has other contents"):
        trocar.verify(record)


def test_two_tips_of_one_name_are_drawn_apart(tmp_path):
    for place, low in (("a", 0.001), ("b", 0.004)):
        (tmp_path / place).mkdir()
        file = model(tmp_path / place)
        write_stl(tmp_path / place / "meshes" / "left.stl", box(1, low))
        (tmp_path / place / "tip.yaml").write_text(import_tip(file, name="tip").file.text())
    arms = {
        arm: {"instrument": "400006", "tip": f"{place}/tip.yaml"}
        for arm, place in (("PSM1", "a"), ("PSM2", "b"))
    }
    scene = SceneParams.model_validate({"arms": arms}, context=Files(tmp_path).context)
    drawn = [looks.parts(arm.tool)["jaw_left"][0].vertices for arm in scene.arms.values()]
    assert not np.array_equal(*drawn)
    from engines.mujoco.model.scene import build

    names = build(scene).names
    assert b"PSM1/tip/jaw_left" in names
    assert b"PSM2/tip/jaw_left" in names


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"scale": 1000.0}, "20.1 m long.*--scale 0.001"),
        ({"kind": "prismatic"}, "no two links turn.*links with a hinge: arm"),
        ({"extra": link("third") + joint("third", "0 1 0")}, "several pairs.*left, right, third.*--fingers"),
        ({"apart": radians(170.0)}, "more than 140 degrees apart.*nearer to closed"),
    ],
)
def test_what_is_no_jaw_is_refused_with_the_remedy(tmp_path, change, said):
    file = model(tmp_path, **change)
    with pytest.raises(ScenarioError, match=f"{re.escape(str(file))}: .*{said}"):
        import_tip(file, name="own")


def test_fingers_of_a_model_with_several_are_named(tmp_path):
    file = model(tmp_path, extra=link("third") + joint("third", "0 1 0"))
    assert import_tip(file, name="own", fingers=["right", "left"]).file.source == "tool.urdf: left, right"
    with pytest.raises(ScenarioError, match=r"no link 'rihgt'.*Did you mean 'right'"):
        import_tip(file, name="own", fingers=["left", "rihgt"])


def test_a_missing_mesh_and_a_xacro_say_what_to_do(tmp_path):
    file = model(tmp_path)
    (tmp_path / "meshes" / "right.stl").unlink()
    with pytest.raises(
        ScenarioError, match=r"mesh 'package://tool/meshes/right.stl'.*put 'right.stl' beside"
    ):
        import_tip(file, name="own")
    with pytest.raises(ScenarioError, match=r"xacro FILE > FILE.urdf"):
        import_tip(tmp_path / "tool.urdf.xacro", name="own")


def test_fingers_need_an_instrument_with_a_jaw(tmp_path):
    (tmp_path / "tip.yaml").write_text(import_tip(model(tmp_path), name="tip").file.text())
    with pytest.raises(ValueError, match=r"'palpation-probe' has no plain jaw.*such as 400006"):
        SceneParams.model_validate({"arms": {"PSM1": {"tip": "tip.yaml"}}}, context=Files(tmp_path).context)
    with pytest.raises(ValueError, match=r"cannot read .*missing.yaml"):
        SceneParams.model_validate(
            {"arms": {"PSM1": {"instrument": "400006", "tip": "missing.yaml"}}},
            context=Files(tmp_path).context,
        )
