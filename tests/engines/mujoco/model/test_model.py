from itertools import combinations

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engines.mujoco.model import build, first_sensor, probe_body
from engines.mujoco.model.tree import links
from engines.mujoco.params import SceneParams
from robots import rotation
from robots.dvrk import setup_joints
from robots.dvrk.end_effectors.jaw import FINGERS
from robots.dvrk.linkage import LINKAGES
from robots.dvrk.mounted.mounted_ecm import MountedEcm

ARMS = ("PSM1", "PSM2", "PSM3", "ECM")
ORIENTATION = rotation.exp(np.array([0.3, -0.5, 0.7]))
POSITION = np.array([0.1, -0.2, 0.3])


def scene(**arms):
    return SceneParams.model_validate({"arms": arms, "looks": False})


FREE = scene(
    PSM1={"instrument": "400006", "position": POSITION.tolist(), "orientation": ORIENTATION.tolist()},
    PSM2={"instrument": "400049", "position": [1, 0, 0]},
    PSM3={"position": [2, 0, 0], "probe_radius": "4 mm"},
    ECM={"endoscope": "up", "position": [3, 0, 0]},
)
CART = SceneParams.model_validate(
    {"mounting": "cart", "arms": {arm: {} if arm == "ECM" else {"instrument": "420006"} for arm in ARMS}}
)
MODEL, CART_MODEL = build(FREE), build(CART)
fractions = st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6).map(np.array)


def positions(chain, fraction):
    return chain.lower + fraction[: len(chain.joints)] * (chain.upper - chain.lower)


def place(model, data, arm, params, q):
    """Put an arm's joints at `q`, its linkage where it follows, and its fingers closed."""
    known = dict(zip([joint.name for joint in params.chain.joints], q, strict=True))
    for link in links(arm, params):
        value = (
            known.get(link.name, 0.0) if link.follow is None else link.follow.ratio * known[link.follow.joint]
        )
        data.joint(f"{arm}/{link.name}").qpos[0] = value
        if link.follow is None:
            data.ctrl[model.actuator_ctrladr[model.actuator(f"{arm}/{link.name}").id]] = value


def gaps(model, data, arm, params):
    """Distances (m) between the two halves of every pin of the linkage."""
    zero = {link.name: link.pose for link in links(arm, params)}

    def at(body, point):
        local = zero[body][:3, :3].T @ (np.array(point) - zero[body][:3, 3])
        found = data.body(f"{arm}/{body}")
        return found.xpos + found.xmat.reshape(3, 3) @ local

    return [
        np.linalg.norm(at(pin.bodies[0], pin.position) - at(pin.bodies[1], pin.position))
        for pin in LINKAGES[arm].pins
    ]


@given(fractions)
def test_kinematics_are_those_of_the_dh_table(fraction):
    data = mujoco.MjData(MODEL)
    expected = {}
    for arm, params in FREE.arms.items():
        q = positions(params.chain, fraction)
        place(MODEL, data, arm, params, q)
        expected[arm] = params, params.chain.forward(q)
    mujoco.mj_forward(MODEL, data)
    for arm, (params, tip) in expected.items():
        base = rotation.matrix(np.array(params.orientation))
        found = data.site(f"{arm}/tip")
        assert np.allclose(found.xpos, params.position + base @ tip[:3, 3], atol=1e-12)
        assert np.allclose(found.xmat.reshape(3, 3), base @ tip[:3, :3], atol=1e-12)


@given(fractions)
def test_the_pivots_of_the_linkages_meet_in_every_position(fraction):
    data = mujoco.MjData(MODEL)
    for arm, params in FREE.arms.items():
        place(MODEL, data, arm, params, positions(params.chain, fraction))
    mujoco.mj_forward(MODEL, data)
    for arm, params in FREE.arms.items():
        assert max(gaps(MODEL, data, arm, params)) < 1e-12


@pytest.mark.parametrize("arm", ["PSM1", "ECM"])
def test_the_pivots_of_the_linkages_meet_in_motion(arm):
    params = FREE.arms[arm]
    data = mujoco.MjData(MODEL)
    place(MODEL, data, arm, params, params.start)
    middle = np.array([*params.start][:3])
    swing = np.array([0.5, 0.5, 0.06])
    frequency = 0.8 * params.chain.velocity[:3] / swing
    worst = 0.0
    for i in range(2000):
        t = i * MODEL.opt.timestep
        for joint, q, v in zip(
            ("yaw", "pitch", "insertion"),
            middle + swing * np.sin(frequency * t),
            swing * frequency * np.cos(frequency * t),
            strict=True,
        ):
            at = MODEL.actuator_ctrladr[MODEL.actuator(f"{arm}/{joint}").id]
            data.ctrl[at : at + 2] = q, v
        mujoco.mj_step(MODEL, data)
        worst = max(worst, *gaps(MODEL, data, arm, params))
    assert abs(data.joint(f"{arm}/pitch").qpos[0] - middle[1]) > 0.05  # it has moved
    assert worst < 1e-4


def test_base_frames_on_the_cart_are_those_of_the_setup_joints():
    data = mujoco.MjData(CART_MODEL)
    mujoco.mj_forward(CART_MODEL, data)
    for arm in ARMS:
        base = setup_joints.base_pose(arm, np.array(setup_joints.SIMULATED[arm]))
        assert np.allclose(data.site(f"{arm}/base").xpos, base[:3, 3], atol=1e-12)
        assert np.allclose(data.site(f"{arm}/base").xmat.reshape(3, 3), base[:3, :3], atol=1e-12)


def test_setup_joints_are_settable():
    q = (0.1, -0.2, 0.3, -0.4, 0.5, -0.6)
    set_so = CART.model_copy(update={"setup_joints": {"PSM2": q}})
    model = build(set_so)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert np.allclose(
        data.site("PSM2/base").xpos, setup_joints.base_pose("PSM2", np.array(q))[:3, 3], atol=1e-12
    )
    assert model.nq == CART_MODEL.nq  # braked: none of them is free to move


@pytest.mark.parametrize("arms", [pair for n in (1, 2, 3) for pair in combinations(ARMS, n)], ids="+".join)
def test_every_part_of_the_cart_is_a_model(arms):
    model = build(
        SceneParams.model_validate({"mounting": "cart", "arms": {arm: {} for arm in arms}, "looks": False})
    )
    for arm, params in CART.arms.items():
        if arm in arms:
            moving = len(params.chain.joints) + len(LINKAGES[arm].joints)
            assert sum(model.joint(i).name.startswith(f"{arm}/") for i in range(model.njnt)) == moving


def test_arms_on_the_cart_touch_nothing_at_their_start():
    data = mujoco.MjData(CART_MODEL)
    for arm, params in CART.arms.items():
        place(CART_MODEL, data, arm, params, params.start)
    mujoco.mj_forward(CART_MODEL, data)
    assert data.ncon == 0


def test_fingers_open_either_way_by_half_the_jaw_angle():
    data = mujoco.MjData(MODEL)
    angle = 0.6
    for side in FINGERS:
        data.joint(f"PSM1/{side}").qpos[0] = angle / 2
    mujoco.mj_forward(MODEL, data)
    tip = data.site("PSM1/tip").xmat.reshape(3, 3)
    left, right = (
        tip.T @ data.body(f"PSM1/{side}").xmat.reshape(3, 3) @ [0.0, forth, 0.0]
        for side, forth in zip(FINGERS, (1, -1), strict=True)
    )
    assert np.allclose(left, [0.0, np.sin(angle / 2), np.cos(angle / 2)])
    assert np.allclose(right, [0.0, -np.sin(angle / 2), np.cos(angle / 2)])


def test_fingers_have_half_the_range_of_the_jaw():
    jaw = FREE.arms["PSM2"].tool.jaw
    for side in FINGERS:
        assert np.allclose(MODEL.joint(f"PSM2/{side}").range, [jaw.lower / 2, jaw.upper / 2])


def test_the_centre_of_mass_of_the_probe_is_the_tip():
    data = mujoco.MjData(MODEL)
    place(MODEL, data, "PSM3", FREE.arms["PSM3"], [0.3, -0.2, 0.15, 0.5, -0.4, 0.25])
    mujoco.mj_forward(MODEL, data)
    assert np.allclose(data.body(probe_body("PSM3")).xipos, data.site("PSM3/tip").xpos, atol=1e-15)


def test_sensors_lie_in_the_order_that_is_told():
    data = mujoco.MjData(MODEL)
    q = np.array([0.3, -0.2, 0.15, 0.5, -0.4, 0.25])
    place(MODEL, data, "PSM1", FREE.arms["PSM1"], q)
    data.joint("PSM1/jaw_right").qpos[0] = 0.1
    mujoco.mj_forward(MODEL, data)
    sensors = data.sensordata[MODEL.sensor(first_sensor("PSM1")).adr[0] :]
    assert np.allclose(sensors[:6], q)
    assert np.allclose(sensors[18:21], FREE.arms["PSM1"].chain.forward(q)[:3, 3])
    assert np.allclose(sensors[25:28], data.site("PSM1/tip").xpos)
    assert np.allclose(sensors[38:40], [0.0, 0.1])


def test_looks_neither_weigh_nor_collide():
    bare = build(CART.model_copy(update={"looks": "none"}))
    assert CART_MODEL.ngeom > bare.ngeom
    assert np.array_equal(CART_MODEL.body_mass, bare.body_mass)
    seen = (CART_MODEL.geom_contype == 0) & (CART_MODEL.geom_conaffinity == 0)
    assert CART_MODEL.ngeom - seen.sum() == bare.ngeom


def test_an_arm_collides_with_things_and_with_other_instruments_but_not_with_itself():
    def meet(first, second):
        a, b = (CART_MODEL.geom(name) for name in (first, second))
        return bool(a.contype[0] & b.conaffinity[0] or b.contype[0] & a.conaffinity[0])

    assert meet("PSM1/shaft", "PSM2/jaw_left")
    assert meet("PSM1/wrist", "ECM/shaft")
    assert not meet("PSM1/jaw_left", "PSM1/jaw_right")
    assert not meet("PSM1/pitch_hull", "PSM2/pitch_hull")
    thing = 1  # MuJoCo's default of contype and conaffinity
    for name in ("PSM1/pitch_hull", "PSM1/jaw_left", "ECM/shaft"):
        assert CART_MODEL.geom(name).conaffinity[0] & thing


def test_start_outside_the_joint_range_is_refused():
    with pytest.raises(ValueError, match=r"joint insertion at 0\.3 m, allowed are 0 \.\. 0\.24"):
        scene(PSM1={"start": [0, 0, 0.3, 0, 0, 0]})


def test_orientation_must_be_a_unit_quaternion():
    with pytest.raises(ValueError, match="no unit quaternion"):
        scene(PSM1={"orientation": [1, 1, 0, 0]})


def test_the_endoscope_tips_the_camera():
    straight, up = (build(scene(ECM={"endoscope": kind})) for kind in ("straight", "up"))
    turns = []
    for model in (straight, up):
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        turns.append(data.site("ECM/tip").xmat.reshape(3, 3))
    assert np.allclose(turns[0].T @ turns[1], rotation.matrix(rotation.exp(np.array([-np.pi / 6, 0, 0]))))


def test_ecm_params_have_the_endoscope_chain():
    assert isinstance(FREE.arms["ECM"], MountedEcm)
    assert len(FREE.arms["ECM"].chain.joints) == 4
