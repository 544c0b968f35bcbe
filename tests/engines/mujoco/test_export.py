import json
import logging

import mujoco
import numpy as np
import pytest
import yourdfpy
from typer.testing import CliRunner

from engines.mujoco.command_line import app
from engines.mujoco.export import START, write
from engines.mujoco.model import build, spec, ties
from engines.mujoco.params import SceneParams
from robots.dvrk import setup_joints
from robots.dvrk.linkage import LINKAGES

SCENE = SceneParams.model_validate(
    {
        "mounting": "cart",
        "arms": {
            "PSM1": {"instrument": "400006"},
            "PSM3": {"instrument": "400172"},
            "ECM": {"endoscope": "down"},
        },
        "setup_joints": {"PSM1": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]},
    }
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    where = tmp_path_factory.mktemp("export")
    write(SCENE, where / "dvrk.xml", "mjcf")
    write(SCENE, where / "dvrk.urdf", "urdf")
    return where


def some_positions(model):
    lower, upper = model.jnt_range.T
    return np.random.default_rng(1).uniform(lower, upper)


def as_in_a_session():
    whole = spec(SCENE)
    ties.add(whole, SCENE)
    return whole.compile()


def test_mjcf_reads_back_as_it_was(folder):
    model, back = as_in_a_session(), mujoco.MjModel.from_xml_path(str(folder / "dvrk.xml"))
    assert (model.nq, model.nv, model.nu, model.neq, model.ngeom, model.nsensor) == (
        back.nq,
        back.nv,
        back.nu,
        back.neq,
        back.ngeom,
        back.nsensor,
    )
    for field in (
        "body_mass",
        "body_inertia",
        "body_ipos",
        "body_pos",
        "jnt_range",
        "jnt_stiffness",
        "qpos_spring",
        "dof_damping",
        "dof_armature",
    ):
        assert np.allclose(getattr(model, field), getattr(back, field), rtol=1e-12, atol=1e-15), field
    for field in (
        "dof_frictionloss",
        "actuator_biasprm",
        "actuator_forcerange",
        "tendon_frictionloss",
        "body_gravcomp",
    ):
        assert np.allclose(getattr(model, field), getattr(back, field), rtol=1e-5), field
    assert [model.body(i).name for i in range(model.nbody)] == [back.body(i).name for i in range(back.nbody)]
    data, other = mujoco.MjData(model), mujoco.MjData(back)
    data.qpos[:] = other.qpos[:] = some_positions(model)
    mujoco.mj_forward(model, data)
    mujoco.mj_forward(back, other)
    assert np.allclose(data.site_xpos, other.site_xpos, atol=1e-12)
    assert np.allclose(data.xmat, other.xmat, atol=1e-12)


def test_a_keyframe_holds_the_arms_where_they_start(folder):
    model = mujoco.MjModel.from_xml_path(str(folder / "dvrk.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(START).id)
    start = data.qpos.copy()
    assert data.joint("PSM1/insertion").qpos[0] == SCENE.arms["PSM1"].start[2] > 0.1
    assert data.joint("PSM1/counterweight").qpos[0] == -SCENE.arms["PSM1"].start[2]
    mujoco.mj_step(model, data, nstep=1000)
    # no more than the springs of roll and pitch pull their servos away
    assert np.abs(data.qpos - start).max() < 5e-3


def test_fingers_of_the_mjcf_are_one_jaw(folder):
    model = mujoco.MjModel.from_xml_path(str(folder / "dvrk.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(START).id)
    data.joint("PSM1/jaw_left").qfrc_applied = 0.02
    mujoco.mj_step(model, data, nstep=400)
    left, right = (float(data.joint(f"PSM1/jaw_{side}").qpos[0]) for side in ("left", "right"))
    assert left > 1e-4
    assert abs(left - right) < 1e-5


def test_brakes_of_the_mjcf_hold_the_endoscope_where_it_starts(folder):
    model = mujoco.MjModel.from_xml_path(str(folder / "dvrk.xml"))
    names = [joint.name for joint in SCENE.arms["ECM"].chain.joints]
    locks = [model.equality(ties.brake(name)).id for name in names]
    assert np.array_equal(model.eq_data[locks, 0], SCENE.arms["ECM"].start)
    assert not model.eq_active0[locks].any()

    def sunk(*, braked):
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key(START).id)
        data.eq_active[locks] = braked
        model.actuator_gainprm[:] = model.actuator_biasprm[:] = model.body_gravcomp[:] = 0.0
        mujoco.mj_step(model, data, nstep=400)
        found = [float(data.joint(f"ECM/{name}").qpos[0]) for name in names]
        return np.abs(np.array(found) - SCENE.arms["ECM"].start).max()

    assert sunk(braked=True) < 1e-4
    assert sunk(braked=False) > 1e-2


def test_meshes_read_back_where_they_were(folder):
    model, back = build(SCENE), mujoco.MjModel.from_xml_path(str(folder / "dvrk.xml"))
    data, other = mujoco.MjData(model), mujoco.MjData(back)
    mujoco.mj_forward(model, data)
    mujoco.mj_forward(back, other)
    assert np.allclose(data.geom_xpos, other.geom_xpos, atol=1e-6)
    assert model.mesh_facenum.sum() == back.mesh_facenum.sum()


@pytest.fixture(scope="module")
def robot(folder):
    logging.getLogger("yourdfpy").setLevel(logging.ERROR)
    return yourdfpy.URDF.load(str(folder / "dvrk.urdf"), load_meshes=False)


def test_urdf_has_the_tip_poses_of_the_arms(robot):
    rng = np.random.default_rng(2)
    for arm, params in SCENE.arms.items():
        q = rng.uniform(params.chain.lower, params.chain.upper)
        robot.update_cfg(
            {f"{arm}_{joint.name}": value for joint, value in zip(params.chain.joints, q, strict=True)}
        )
        assert np.allclose(
            robot.get_transform(f"{arm}_tip", f"{arm}_base"), params.chain.forward(q), atol=1e-12
        )


def test_urdf_moves_the_linkage_with_the_arm(robot):
    pitch = 0.4
    robot.update_cfg({"PSM1_pitch": pitch, "PSM1_yaw": 0.2, "PSM1_insertion": 0.1})
    zero = np.zeros(len(robot.actuated_joint_names))
    for pin in LINKAGES["PSM1"].pins:
        robot.update_cfg(zero)
        local = [
            np.linalg.inv(robot.get_transform(f"PSM1_{body}_link", "PSM1_base")) @ [*pin.position, 1.0]
            for body in pin.bodies
        ]
        robot.update_cfg({"PSM1_pitch": pitch, "PSM1_yaw": 0.2})
        first, second = (
            robot.get_transform(f"PSM1_{body}_link", "PSM1_base") @ point
            for body, point in zip(pin.bodies, local, strict=True)
        )
        assert np.allclose(first, second, atol=1e-12)
        assert not np.allclose(first[:3], pin.position, atol=1e-3)


def test_urdf_opens_both_fingers_by_half_the_jaw(robot):
    robot.update_cfg({"PSM1_jaw": 0.6})
    left, right = (
        robot.get_transform(f"PSM1_{side}_link", "PSM1_wrist_yaw_link")[:3, :3]
        for side in ("jaw_left", "jaw_right")
    )
    assert np.allclose(left[:, 0], [np.cos(0.3), np.sin(0.3), 0.0])
    assert np.allclose(right[:, 0], [np.cos(0.3), -np.sin(0.3), 0.0])
    jaw = SCENE.arms["PSM1"].tool.jaw
    limit = robot.joint_map["PSM1_jaw"].limit
    assert (limit.lower, limit.upper, limit.effort) == (jaw.lower, jaw.upper, jaw.effort)


def test_urdf_has_the_masses_of_the_model(robot):
    model = build(SCENE)
    masses = {link.name: link.inertial.mass for link in robot.robot.links if link.inertial is not None}
    assert sum(masses.values()) == pytest.approx(model.body_mass.sum())
    assert masses["PSM1_pitch_link"] == pytest.approx(model.body("PSM1/pitch").mass[0])


def test_setup_joints_have_masses_that_move_nothing(robot):
    model = build(SCENE)
    held = {joint: float(model.body(f"SUJ/PSM1/{joint}").mass[0]) for joint in setup_joints.JOINT_NAMES}
    assert list(held.values()) == pytest.approx(setup_joints.MASSES["PSM1"])
    assert float(model.body("cart").mass[0]) == pytest.approx(setup_joints.CART_MASS)
    masses = {link.name: link.inertial.mass for link in robot.robot.links if link.inertial is not None}
    assert masses["SUJ_PSM1_shoulder_link"] == pytest.approx(held["shoulder"])
    assert not model.body_dofnum[[model.body("cart").id, model.body("SUJ/PSM1/tilt").id]].any()


def test_mujoco_reads_the_urdf(folder):
    """MuJoCo rejects moving links without mass, finds meshes beside the file, and makes mimics equalities."""
    model = mujoco.MjModel.from_xml_path(str(folder / "dvrk.urdf"))
    params = SCENE.arms["PSM1"]
    q = np.random.default_rng(3).uniform(params.chain.lower, params.chain.upper)
    data = mujoco.MjData(model)
    for joint, value in zip(params.chain.joints, q, strict=True):
        data.joint(f"PSM1_{joint.name}").qpos = value
    mujoco.mj_kinematics(model, data)
    expected = (
        setup_joints.base_pose("PSM1", np.array(SCENE.setup_joints["PSM1"])) @ params.chain.frames(q)[5]
    )
    assert np.allclose(data.body("PSM1_wrist_yaw_link").xpos, expected[:3, 3], atol=1e-9)
    assert model.neq == 2 * 7 + 4
    assert model.nmesh


def test_urdf_meshes_are_beside_it(folder, robot):
    names = {
        visual.geometry.mesh.filename
        for link in robot.robot.links
        for visual in link.visuals
        if visual.geometry.mesh
    }
    assert names
    assert all((folder / name).is_file() for name in names)


def run(*words):
    return CliRunner().invoke(app, words)


@pytest.mark.parametrize(
    "written",
    [
        ("--q", "0.3", "-0.2", "0.15", "0.5", "-0.4", "0.25"),
        ("--q", "0.3,-0.2,0.15,0.5,-0.4,0.25"),
        ("--q=0.3 -0.2 0.15 0.5 -0.4 0.25",),
    ],
)
def test_positions_are_numbers_in_a_row(written):
    result = run("fk", "PSM1", *written, "--instrument", "400006", "--json")
    assert result.exit_code == 0
    assert np.allclose(json.loads(result.stdout)["p"], [0.042794255, 0.031414240, -0.132593198], atol=1e-9)


def test_first_position_may_be_negative():
    result = run("fk", "--json", "ECM", "--q", "-0.4", "-0.3", ".1", "-0.5")
    assert result.exit_code == 0
    assert json.loads(result.stdout)["q"] == [-0.4, -0.3, 0.1, -0.5]


def test_dynamics_are_those_of_the_model():
    result = run(
        "dynamics",
        "PSM1",
        "--q",
        "0.3",
        "-0.2",
        "0.15",
        "0.5",
        "-0.4",
        "0.25",
        "--dq",
        ".1",
        ".1",
        ".01",
        "0",
        "0",
        "0",
        "--json",
    )
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert found["joints"] == ["yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw"]
    inertia = np.array(found["inertia"])
    identified = np.array(
        [
            [0.187651513, 0.0185569597, -0.000980066578],
            [0.0185569597, 0.204328846, 0.033],
            [-0.000980066578, 0.033, 0.4167],
        ]
    )
    assert np.allclose(inertia, inertia.T)
    assert np.linalg.eigvalsh(inertia).min() > 0
    assert np.abs(inertia[:3, :3] - identified).max() < 0.05 * identified.max()
    assert np.allclose(found["gravity"][:3], [0.175379166, -0.182047853, -0.539161725], atol=1e-3)
    assert np.allclose(found["friction"][:3], [0.0766338642, 0.16430385, 0.302321826], atol=1e-6)
    assert np.allclose(found["elastic"][:4], [0.0478078173, 0.0047528671, 0.0, 0.00505], atol=1e-6)


def test_dynamics_for_a_person():
    result = run("dynamics", "ECM", "--q", "0,0,0.1,0")
    assert result.exit_code == 0
    assert [line.split()[0] for line in result.stdout.splitlines()] == [
        "gravity",
        "yaw",
        "pitch",
        "insertion",
        "roll",
    ]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("fk", "PSM1", "--q", "0,0"), "expected 6"),
        (("fk", "PSM1", "--q", "9,0,0,0,0,0"), "-1.588 .. 1.588"),
        (("fk", "PSM1", "--q", "a"), "contains no numbers"),
        (("fk", "PSM9", "--q", "0"), "PSM1"),
        (("fk", "PSM1", "--q", "nan,0,0,0,0,0"), "nan"),
        (("dynamics", "MTML", "--q", "0"), "no arm 'MTML' in the model"),
        (("dynamics", "PSM1", "--instrument", "12", "--q", "0,0,0,0,0,0"), "no instrument '12'"),
        (("dynamics", "PSM1", "--q", "0,0,0,0,0,0", "--dq", "0"), "1 joint velocities, expected 6"),
        (
            ("dynamics", "PSM1", "--q", "0,0,0,0,0,0", "--dq", "0,0,0,0,0,inf"),
            "not all joint velocities are finite",
        ),
        (("export", "x", "--arms", "PSM1,PSM2", "--mounting", "free"), "same place"),
        (("export", "x", "--instrument", "PSM1"), "write for instance PSM1=400006"),
        (("export", "x", "--arms", "PSM7"), "no arm 'PSM7'"),
        (("export", "x", "--arms", ""), "at least one of PSM1, PSM2, PSM3, ECM"),
        (("export", "/dev/null/x"), "Invalid value for PATH: cannot write there"),
        (("dynamics", "ECM", "--q", "0 0 0.1 0", "--orientation", "1 0 0"), "3 numbers, expected 4"),
        (
            ("dynamics", "ECM", "--q", "0 0 0.1 0", "--mounting", "cart", "--orientation", "0 0 0 1"),
            "for 'mount",
        ),
        (("dynamics", "ECM", "--q", "0 0 0.1 0", "--setup-joints", "0 0 0 0 0 0"), "set 'mounting: cart'"),
        (("export", "x", "--instrument", "PSM1=400143"), "snake"),
    ],
)
def test_bad_usage_is_refused_with_what_is_allowed(words, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run(*words)
    assert result.exit_code == 2
    assert message in " ".join(result.output.replace("│", " ").split())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "words", "file"),
    [
        ("a.urdf", (), "a.urdf"),
        ("b.xml", (), "b.xml"),
        ("c", ("--format", "urdf"), "c/dvrk.urdf"),
        ("d", (), "d/dvrk.xml"),
    ],
)
def test_export_writes_what_the_name_says(tmp_path, name, words, file):
    result = run(
        "export",
        str(tmp_path / name),
        "--arms",
        "PSM1",
        "--instrument",
        "PSM1=400049",
        "--mounting",
        "free",
        *words,
    )
    assert result.exit_code == 0, result.output
    assert (tmp_path / file).is_file()
    assert list((tmp_path / file).parent.glob("assets/*.obj"))


def test_urdf_slides_the_pads_of_a_roller_against_each_other(tmp_path):
    scene = SceneParams.model_validate({"arms": {"PSM1": {"instrument": "ROLLING_NEEDLE_DRIVER"}}})
    write(scene, tmp_path / "dvrk.urdf", "urdf")
    robot = yourdfpy.URDF.load(str(tmp_path / "dvrk.urdf"), load_meshes=False)
    jaw = scene.arms["PSM1"].tool.jaw
    limit = robot.joint_map["PSM1_roller"].limit
    roller = jaw.roller
    assert (limit.lower, limit.upper, limit.effort) == (roller.lower, roller.upper, roller.effort)
    robot.update_cfg({"PSM1_roller": 0.5})
    left, right = (
        robot.get_transform(f"PSM1_pad_{side}_link", "PSM1_wrist_yaw_link")[:3, 3]
        for side in ("left", "right")
    )
    ahead = scene.arms["PSM1"].tool.tip[:3, 2]
    assert np.allclose(left, 0.5 * jaw.wire_radius * ahead)
    assert np.allclose(right, -0.5 * jaw.wire_radius * ahead)
