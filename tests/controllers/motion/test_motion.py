import json
from math import radians
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from controllers.motion.controller import MotionController
from controllers.motion.joint_errors import JointErrors
from controllers.motion.params import MotionParams
from hub.testing import check_engine
from robots import rotation
from robots.dvrk import arms
from schemas.crtk import StringStamped
from schemas.errors import StateError
from schemas.ros import (
    BoolMessage,
    Float64Message,
    Header,
    JointState,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Vector3,
    Wrench,
    WrenchStamped,
)
from tests.controllers.motion.rig import CART, EMPTY, HOME, H, Rig, cf, ci, cp, cs, jf, jp, ratio

CHAIN = arms.chain("PSM1")
GOAL = HOME + np.array([0.1, -0.1, 0.02, 0.2, 0.1, -0.1])
COMPOSITION = json.loads((Path(__file__).parent / "data/cart_composition.json").read_text())
MOTIONS = {
    "hold": EMPTY,
    "free": EMPTY,
    "servo_jp": jp(*GOAL),
    "servo_jr": jp(*[0.001] * 6),
    "servo_jf": jf(*[0.0] * 6),
    "servo_cp": cp([0.01, 0.0, -0.11, 0.70710678, 0.70710678, 0, 0], "PSM1_base"),
    "servo_cr": cp([0.001, 0.0, 0.0, 0, 0, 0, 1]),
    "servo_cs": cs([0.01, 0.0, -0.11, 0.70710678, 0.70710678, 0, 0], frame="PSM1_base"),
    "servo_ci": ci([0.0, 0.0, -0.12, 0, 0, 0, 1]),
    "body__servo_cf": cf(*[0.0] * 6),
    "spatial__servo_cf": cf(*[0.0] * 6),
    "move_jp": jp(*GOAL),
    "move_jr": jp(*[0.001] * 6),
    "move_cp": cp([0.01, 0.0, -0.11, 0.70710678, 0.70710678, 0, 0], "PSM1_base"),
    "jaw__servo_jp": jp(0.3),
    "jaw__servo_jf": jf(0.1),
    "jaw__move_jp": jp(0.3),
}


@pytest.mark.parametrize("state", ["disabled", "homed"])
def test_the_contract_of_participants_is_kept(state):
    params = MotionParams.model_validate({"mounting": "cart", "arms": CART, "initial_state": state})
    at_home = {f"sense/{arm}/measured_js": [*HOME, *[0.0] * 12] for arm in ("PSM1", "PSM2", "PSM3")}
    orders = {"PSM1/move_jp": (jp(*GOAL),), "PSM2/state_command": (StringStamped(string="home"),)}
    check_engine(lambda: MotionController("motion", params), period_ns=H, inputs={**at_home, **orders})


def test_home_powers_then_homes():
    rig = Rig({"PSM1": {"instrument": "400006", "start": GOAL}}, initial_state="disabled").step()
    assert rig.states() == [("DISABLED", False, False)]
    assert rig.mode == [0, 0]
    rig.command("home")
    assert rig.states() == [("DISABLED", False, True)]
    rig.step(100)
    assert rig.states() == [("ENABLED", False, True)]
    assert rig.mode == [1, 1]
    rig.until_idle()
    assert rig.states() == [("ENABLED", True, False)]
    assert np.allclose(rig.setpoint, HOME, atol=1e-12)


def test_homing_that_is_paused_goes_on_when_it_is_resumed():
    rig = (
        Rig({"PSM1": {"instrument": "400006", "start": GOAL}}, initial_state="disabled")
        .step()
        .command("home")
        .step(200)
    )
    assert rig.command("pause").states() == [("PAUSED", False, False)]
    rig.step(100)
    before = rig.setpoint
    assert (rig.step(100).setpoint == before).all()
    assert rig.command("resume").states() == [("ENABLED", False, True)]
    assert rig.until_idle().states() == [("ENABLED", True, False)]
    assert np.allclose(rig.setpoint, HOME, atol=1e-12)


def test_a_stream_of_joints_may_state_its_velocity():
    lag = {}
    for stated in (False, True):
        rig, errors = Rig().step(), []
        for k in range(0, 1000, 10):
            angle, spread = 2 * np.pi * 0.5 * (k + 10) * 1e-3, np.array([1, 1, 0.2, 1, 1, 1])
            goal, velocity = HOME + 0.05 * (1 - np.cos(angle)) * spread, 0.05 * np.pi * np.sin(angle) * spread
            before = rig.step(
                9, servo_jp=JointState(position=goal, velocity=velocity if stated else np.zeros(6))
            ).setpoint
            errors.append(np.abs((rig.step().setpoint - before) / 1e-3 - velocity).max())
        lag[stated] = max(errors[20:])
        assert not rig.said("error")
    assert lag[True] < 0.2 * lag[False]


def test_home_of_a_homed_arm_moves_nothing_but_is_answered():
    rig = Rig().step(2, move_jp=jp(*GOAL)).until_idle()
    before = rig.setpoint
    rig.command("home")
    assert rig.states() == [("ENABLED", True, False)]
    assert (rig.step(100).setpoint == before).all()


@pytest.mark.parametrize(
    ("way", "command", "after"),
    [
        ([], "enable", "ENABLED"),
        ([], "disable", "DISABLED"),
        ([], "pause", "PAUSED"),
        ([], "unhome", "ENABLED"),
        ([], "resume", None),
        (["pause"], "resume", "ENABLED"),
        (["pause"], "disable", "DISABLED"),
        (["pause"], "enable", None),
        (["pause"], "home", None),
        (["disable"], "resume", None),
        (["disable"], "pause", None),
        (["disable"], "unhome", "DISABLED"),
        (["disable"], "disable", "DISABLED"),
        ([], "fly", None),
    ],
)
def test_each_state_takes_its_commands(way, command, after):
    rig = Rig().step()
    for earlier in way:
        rig.command(earlier)
    saved = rig.motion._arms["PSM1"]._lifecycle.records[0].values.copy()
    rig.command(command)
    if after is None:
        assert len(rig.said("warning")) == 1
        assert command in rig.said("warning")[0]
        assert (rig.motion._arms["PSM1"]._lifecycle.records[0].values == saved).all()
        assert not rig.states()
    else:
        assert rig.states()[-1][0] == after
        assert not rig.said("warning")


@pytest.mark.parametrize("state", ["disable", "pause", "unhome", "fault", "homing"])
@pytest.mark.parametrize("command", MOTIONS)
def test_motion_in_the_wrong_state_is_refused_with_a_warning(state, command):
    rig = Rig().step()
    if state == "fault":
        rig.follows = False
        rig.sensed["sense/PSM1/measured_js"][0] = 0.6
        rig.step()
        assert rig.states() == [("FAULT", True, False)]
        assert "joint yaw is 0.6 rad from its setpoint, allowed are 0.5" in rig.said("error")[0]
        assert rig.mode == [0, 0]
    elif state == "homing":
        rig.step(1, move_jp=jp(*GOAL)).until_idle().command("unhome").command("home").step(10)
    else:
        rig.command(state).step()
    before, mode = rig.setpoint, rig.mode
    rig.step(1, **{command: MOTIONS[command]})
    assert len(rig.said("warning")) == 1
    assert f"{command.replace('__', '/')} refused: the arm is" in rig.said("warning")[0]
    assert rig.mode == mode
    if state != "homing":
        assert (rig.step(20).setpoint == before).all()


@pytest.mark.parametrize("state", ["disable", "pause", "enable"])
def test_gravity_compensation_is_switched_whatever_the_state_and_kept_over_a_checkpoint(state):
    rig = Rig().step().command(state)
    mode = rig.mode[0]
    rig.step(2, use_gravity_compensation=BoolMessage(data=False))
    assert not rig.said("warning")
    assert rig.mode[0] == (mode + 2 if mode else 0)
    saved = rig.motion.save()
    rig.step(1, use_gravity_compensation=BoolMessage(data=True))
    assert rig.mode[0] == mode
    rig.motion.restore(saved)
    assert rig.mode[0] == (mode + 2 if mode else 0)


@pytest.mark.parametrize("command", MOTIONS)
def test_every_motion_command_is_heeded_when_the_arm_is_homed(command):
    rig = Rig().step().step(5, **{command: MOTIONS[command]})
    assert not rig.said("warning")
    assert not rig.said("error")


@pytest.mark.parametrize("command", ["move_jp", "move_cp", "move_jr", "jaw__move_jp"])
def test_a_move_is_busy_then_reaches_its_goal(command):
    rig = Rig().step().step(1, **{command: MOTIONS[command]})
    assert rig.states() == [("ENABLED", True, True)]
    for _ in range(5000):
        rig.step()
        if rig.said("goal_reached"):
            break
    assert rig.said("goal_reached") == [True]
    assert rig.states() == [("ENABLED", True, False)]


def test_a_move_to_where_the_arm_is_is_busy_for_a_step():
    rig = Rig().step().step(3, move_jp=jp(*HOME))
    assert [busy for _, _, busy in rig.states()] == [True, False]
    stamps = [message.header.stamp.ns for message in rig.heard["PSM1/operating_state"]]
    assert stamps == sorted(set(stamps))


def test_a_move_that_is_taken_over_by_another_goes_on_to_the_new_goal():
    rig = Rig().step().step(200, move_jp=jp(*GOAL))
    rig.step(1, move_jp=jp(*HOME))
    assert rig.states() == [("ENABLED", True, True)]
    rig.until_idle()
    assert rig.said("goal_reached") == [True]
    assert (rig.setpoint == HOME).all()


@pytest.mark.parametrize("command", [name for name in MOTIONS if not name.startswith(("jaw", "move"))])
def test_a_move_that_is_taken_over_by_something_else_is_given_up(command):
    rig = Rig().step().step(200, move_jp=jp(*GOAL)).step(1, **{command: MOTIONS[command]})
    assert rig.said("goal_reached") == [False]
    assert rig.states() == [("ENABLED", True, False)]


def test_hold_stops_where_the_arm_is():
    rig = Rig().step().step(300, move_jp=jp(*GOAL))
    rig.step(200, hold=EMPTY)
    stopped = rig.setpoint
    assert 0.01 < stopped[0] < 0.1
    assert (rig.step(100).setpoint == stopped).all()


def test_free_lets_go_and_the_next_command_starts_where_the_arm_is():
    rig = Rig().step().step(1, free=EMPTY)
    assert rig.mode == [2, 1]
    assert not rig.outputs["drive/PSM1/servo_jf"].any()
    rig.follows = False
    rig.sensed["sense/PSM1/measured_js"][:6] = GOAL
    assert (rig.step().setpoint == GOAL).all()
    rig.step(1, servo_jr=jp(*[0.0] * 6))
    assert rig.mode == [1, 1]
    assert np.allclose(rig.setpoint, GOAL, atol=1e-12)


def test_move_jr_adds_to_the_goal_under_way():
    rig = (
        Rig()
        .step()
        .step(50, move_jr=jp(0.1, 0, 0, 0, 0, 0))
        .step(1, move_jr=jp(0.1, 0, 0, 0, 0, 0))
        .until_idle()
    )
    assert np.allclose(rig.setpoint, HOME + np.array([0.2, 0, 0, 0, 0, 0]), atol=1e-12)


def test_servo_jr_adds_to_the_goal_that_is_followed():
    rig = Rig().step()
    for _ in range(100):
        rig.step(1, servo_jr=(jp(1e-4, 0, 0, 0, 0, 0), jp(1e-4, 0, 0, 0, 0, 0)))
    assert np.allclose(rig.step(100).setpoint, HOME + np.array([0.02, 0, 0, 0, 0, 0]), atol=1e-9)


def test_joints_may_come_in_any_order_if_they_are_named():
    names = [joint.name for joint in CHAIN.joints]
    rig = Rig().step().step(1, move_jp=jp(*GOAL[::-1], names=names[::-1])).until_idle()
    assert (rig.setpoint == GOAL).all()


def construct(part, values):
    return JointState.model_construct(
        **{"name": [], "position": np.zeros(0), "effort": np.zeros(0), part: np.array(values)}
    )


BAD = [
    ("move_jp", jp(2.0, *HOME[1:]), "joint yaw at 2 rad, allowed are -1.588 .. 1.588"),
    ("move_jr", jp(0, 0, 0.2, 0, 0, 0), "joint insertion at 0.32 m, allowed are 0 .. 0.24"),
    ("servo_jp", jp(0.0), "1 values of position, expected 6: yaw"),
    ("servo_jr", jp(*[0.0] * 7), "7 values of position, expected 6"),
    ("servo_jp", jp(*HOME, names="abcdef"), "joints a, b, c, d, e, f, expected yaw, pitch"),
    ("move_cp", cp([0, 0, -0.9, 0.70710678, 0.70710678, 0, 0], "PSM1_base"), "insertion"),
    ("servo_cp", cp([0.0, 0.0, 0.2, 0.70710678, 0.70710678, 0, 0], "PSM1_base"), "cannot be reached"),
    ("move_cp", cp([0, 0, -0.1, 0.8, 0.8, 0, 0], "PSM1_base"), "norm 1.13137, allowed is 1"),
    ("move_cp", cp([0, 0, -0.1, 0, 0, 0, 1], "PSM2_base"), "frame 'PSM2_base', allowed are PSM1_base"),
    ("servo_jf", jf(5.0, *[0.0] * 5), "joint yaw at 5 N m, allowed are -3.3161 .. 3.3161"),
    ("body__servo_cf", cf(*[0.0] * 6, frame="world"), "frame 'world', allowed are PSM1_tip"),
    ("jaw__move_jp", jp(3.0), "joint jaw at 3 rad, allowed are -0.698132 .. 1.39626"),
    ("jaw__servo_jp", jp(-1.0), "allowed are"),
    ("jaw__servo_jf", jf(1.0), "allowed are -0.16 .. 0.16"),
    ("trajectory_j__set_ratio", ratio(0.0), "allowed is above 0 and up to 1"),
    ("move_jp", construct("position", [np.nan] * 6), "every number must be finite"),
    ("servo_jf", construct("effort", [np.inf] * 6), "every number must be finite"),
]


NAN, TOP_DOWN = float("nan"), (0.70710678, 0.70710678, 0.0, 0.0)


def raw_pose(position, orientation, frame="PSM1_base"):
    x, y, z = position
    point, quaternion = (
        Point.model_construct(x=x, y=y, z=z),
        Quaternion.model_construct(**dict(zip("xyzw", orientation, strict=True))),
    )
    return PoseStamped.model_construct(
        header=Header(frame_id=frame), pose=Pose.model_construct(position=point, orientation=quaternion)
    )


def raw_wrench(x, frame):
    vectors = {"force": Vector3.model_construct(x=x, y=0.0, z=0.0), "torque": Vector3()}
    return WrenchStamped.model_construct(
        header=Header(frame_id=frame), wrench=Wrench.model_construct(**vectors)
    )


EVERY = [
    *(
        (command, bad, reason)
        for command in ("servo_jp", "servo_jr", "move_jp", "move_jr")
        for bad, reason in [
            (construct("position", [0.0, NAN, 0.0, 0.0, 0.0, 0.0]), "every number must be finite"),
            (construct("position", [0.0, 0.0, -np.inf, 0.0, 0.0, 0.0]), "every number must be finite"),
            (jp(), "0 values of position, expected 6: yaw, pitch, insertion, roll, wrist_pitch, wrist_yaw"),
            (jp(*[0.0] * 5), "5 values of position, expected 6"),
            (jp(0, 0, 0, 0, 2.0, 0), "joint wrist_pitch at 2 rad, allowed are -1.39626 .. 1.39626"),
            (jp(*HOME, names=["yaw"] * 6), "joints yaw, yaw, yaw, yaw, yaw, yaw, expected yaw, pitch"),
        ]
    ),
    *(
        (command, bad, reason)
        for command in ("servo_cp", "move_cp")
        for bad, reason in [
            (raw_pose((0.0, NAN, -0.1), TOP_DOWN), "position [0.0, nan, -0.1]: every number must be finite"),
            (raw_pose((0.0, 0.0, -0.1), (NAN, 0.0, 0.0, 1.0)), "every number must be finite"),
            (raw_pose((0.0, 0.0, -0.1), (0.0, 0.0, 0.0, 0.0)), "norm 0, allowed is 1 within 0.001"),
            (raw_pose((0.0, 0.0, -0.1), TOP_DOWN, "world"), "frame 'world', allowed are PSM1_base"),
            (raw_pose((0.0, 0.0, -0.5), TOP_DOWN), "pose cannot be reached: joint insertion at"),
            (raw_pose((0.3, 0.0, 0.3), TOP_DOWN), "allowed are"),
        ]
    ),
    ("servo_cr", raw_pose((0.0, 0.0, NAN), (0.0, 0.0, 0.0, 1.0)), "every number must be finite"),
    ("servo_cr", raw_pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)), "norm 0, allowed is 1 within 0.001"),
    (
        "servo_cr",
        raw_pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), "PSM2_base"),
        "frame 'PSM2_base', allowed are PSM1_base",
    ),
    (
        "servo_cr",
        raw_pose((0.0, 0.0, -0.5), (0.0, 0.0, 0.0, 1.0)),
        "pose cannot be reached: joint insertion at",
    ),
    (
        "servo_jp",
        JointState.model_construct(name=[], position=HOME, velocity=np.array([0.1]), effort=np.zeros(0)),
        "1 values of velocity, expected 6",
    ),
    (
        "servo_jp",
        JointState.model_construct(name=[], position=HOME, velocity=np.full(6, NAN), effort=np.zeros(0)),
        "every number must be finite",
    ),
    ("body__servo_cf", cf(1e308, 0, 1e308, 0, -1e308, 0), "allowed are numbers up to 1e+09"),
    ("servo_cs", cs(twist=[1e300] * 6), "allowed are numbers up to 1e+09"),
    (
        "servo_ci",
        ci([0.0, 0.0, -0.12, 0, 0, 0, 1], position_positive={"p": (1e300, 0, 0)}),
        "allowed are numbers up to 1e+09",
    ),
    ("servo_ci", ci([0.0, NAN, -0.12, 0, 0, 0, 1]), "every number must be finite"),
    ("servo_ci", ci([0.0, 0.0, -0.12, 0, 0, 0, 0]), "norm 0, allowed is 1 within 0.001"),
    ("servo_ci", ci([0.0, 0.0, -0.12, 0, 0, 0, 1], "world"), "frame 'world', allowed are PSM1_base"),
    *(
        ("servo_cs", bad, reason)
        for bad, reason in [
            (cs([NAN, 0.0, -0.1, *TOP_DOWN]), "position [nan, 0.0, -0.1]: every number must be finite"),
            (cs([0.0, 0.0, -0.1, 0.0, 0.0, 0.0, 0.5]), "norm 0.5, allowed is 1 within 0.001"),
            (cs([0.0, 0.0, -0.5, *TOP_DOWN]), "pose cannot be reached: joint insertion at"),
            (cs(twist=[0.0, NAN, 0.0, 0.0, 0.0, 0.0]), "every number must be finite"),
            (cs(wrench=[0.0] * 6, frame="world"), "frame 'world', allowed are PSM1_base"),
            (
                cs([0.0, 0.0, -0.1, *TOP_DOWN], wrench=[0.0] * 6),
                "a wrench beside a pose or a twist, allowed is one or the other",
            ),
            (
                cs(twist=[0.0] * 6, wrench=[0.0] * 6),
                "a wrench beside a pose or a twist, allowed is one or the other",
            ),
        ]
    ),
    *(
        (command, bad, reason)
        for command, size in (("servo_jf", 6), ("jaw__servo_jf", 1))
        for bad, reason in [
            (construct("effort", [NAN] * size), "every number must be finite"),
            (jf(*[0.0] * (size + 1)), f"{size + 1} values of effort, expected {size}"),
            (jf(*[99.0] * size), "at 99 N m, allowed are"),
        ]
    ),
    *(
        (f"{kind}__servo_cf", raw_wrench(NAN, frame), "every number must be finite")
        for kind, frame in (("body", "PSM1_tip"), ("spatial", "PSM1_base"))
    ),
    ("spatial__servo_cf", raw_wrench(0.0, "PSM1_tip"), "frame 'PSM1_tip', allowed are PSM1_base"),
    *(
        (command, bad, reason)
        for command in ("jaw__servo_jp", "jaw__move_jp")
        for bad, reason in [
            (construct("position", [NAN]), "every number must be finite"),
            (jp(0.0, 0.0), "2 values of position, expected 1: jaw"),
            (jp(2.0), "joint jaw at 2 rad, allowed are -0.698132 .. 1.39626"),
        ]
    ),
    *(
        (
            f"trajectory_j__set_ratio{which}",
            Float64Message.model_construct(data=bad),
            "allowed is above 0 and up to 1",
        )
        for bad in (NAN, -1.0, 1.1, np.inf)
        for which in ("", "_v", "_a")
    ),
]


def test_every_command_has_bad_input_that_is_tried():
    assert {command for command, *_ in BAD + EVERY} >= set(MOTIONS) - {"hold", "free"}


@pytest.mark.parametrize(("command", "bad", "reason"), [*BAD, *EVERY])
def test_bad_input_is_refused_with_the_reason_and_changes_nothing(command, bad, reason):
    rig, twin = Rig().step(5), Rig().step(5)
    rig.step(1, **{command: bad})
    twin.step(1)
    assert len(rig.said("error")) == 1
    assert rig.said("error")[0].startswith(f"PSM1: {command.replace('__', '/')} refused: ")
    assert reason in rig.said("error")[0]
    assert rig.states() == ([("ENABLED", True, False)] if "move" in command else [])
    for mine, others in zip(
        rig.motion._arms["PSM1"]._drives.state, twin.motion._arms["PSM1"]._drives.state, strict=True
    ):
        assert (mine.values == others.values).all()


@pytest.mark.parametrize("command", ["jaw__move_jp", "jaw__servo_jp"])
def test_a_jaw_opens_by_80_degrees_as_a_client_converts_them(command):
    """The table has 1.39626 rad, less than 80 degrees."""
    rig = Rig().step().step(1, **{command: jp(radians(80.0))})
    assert not rig.said("error")
    if "move" in command:
        rig.until_idle()
    else:
        rig.step(2000)
    assert rig.motion._arms["PSM1"]._drives.gripper.setpoint.position == [1.39626]


@pytest.mark.parametrize("command", ["move_jp", "servo_jp"])
def test_a_wrist_bends_by_80_degrees_as_a_client_converts_them(command):
    rig = Rig().step().step(1, **{command: jp(0.0, 0.0, 0.12, 0.0, radians(80.0), radians(-80.0))})
    assert not rig.said("error")
    if "move" in command:
        rig.until_idle()
    else:
        rig.step(2000)
    assert rig.setpoint[4:].tolist() == [1.39626, -1.39626]


@pytest.mark.parametrize(
    ("command", "bad", "reason"),
    [
        ("jaw__move_jp", jp(1.39628), "joint jaw at 1.39628 rad, allowed are -0.698132 .. 1.39626"),
        ("jaw__move_jp", jp(1.3962701), "joint jaw at 1.39627 rad, allowed are -0.698132 .. 1.39626"),
        (
            "move_jp",
            jp(0, 0, 0.2400011, 0, 0, 0),
            "joint insertion at 0.240001 m, allowed are 0 .. 0.24",
        ),
        (
            "servo_jf",
            jf(3.316103, *[0.0] * 5),
            "joint yaw at 3.316103 N m, allowed are -3.316101 .. 3.316101",
        ),
        ("trajectory_j__set_ratio", ratio(1.0000011), "ratio 1.000001, allowed is above 0 and up to 1"),
    ],
)
def test_a_refusal_just_beyond_a_limit_is_written_with_digits_that_differ(command, bad, reason):
    rig = Rig().step().step(1, **{command: bad})
    assert rig.said("error")[0].endswith(reason)


def test_efforts_and_ratios_beyond_the_limit_by_rounding_are_clamped():
    rig = Rig().step().step(1, servo_jf=jf(3.3161015, *[0.0] * 5), trajectory_j__set_ratio=ratio(1.0 + 1e-9))
    assert not rig.said("error")
    arm = rig.motion._arms["PSM1"]
    assert arm._drives.joints.effort[0] == 3.316101
    assert (arm._commands.settings.ratio == 1.0).all()


def test_a_bad_goal_does_not_disturb_a_move_under_way():
    rig = Rig().step().step(100, move_jp=jp(*GOAL)).step(1, move_jp=jp(*[9.0] * 6))
    assert rig.said("error")
    assert not rig.said("goal_reached")
    rig.until_idle()
    assert (rig.setpoint == GOAL).all()


def test_a_refused_stream_is_told_the_same_once_in_two_seconds():
    rig, told = Rig().step().command("disable"), []
    for _ in range(2100):
        rig.step(1, servo_jp=jp(*HOME))
        told += rig.said("warning")
    assert len(told) == 2
    assert told[1].endswith("(2000 times)")


@pytest.mark.parametrize(
    ("orders", "told"),
    [
        ({"set_ratio": 0.5}, [0.5, 0.5, 0.5]),
        ({"set_ratio_v": 0.25}, [0.0, 0.25, 1.0]),
        ({"set_ratio_a": 0.25}, [0.0, 1.0, 0.25]),
        ({"set_ratio_v": 0.3, "set_ratio_a": 0.3}, [0.3, 0.3, 0.3]),
    ],
)
def test_ratios_are_told_and_slow_moves(orders, told):
    rig = Rig().step().step(10, **{f"trajectory_j__{name}": ratio(value) for name, value in orders.items()})
    assert [
        float(rig.outputs[f"PSM1/trajectory_j/{name}"][0]) for name in ("ratio", "ratio_v", "ratio_a")
    ] == told
    goal = GOAL + np.array([0.9, 0, 0, 0, 0, 0])
    quick, slow = Rig().step().step(600, move_jp=jp(*goal)), rig.step(600, move_jp=jp(*goal))
    assert slow.setpoint[0] < quick.setpoint[0]


@pytest.mark.parametrize("arm", ["PSM1", "PSM2", "PSM3", "ECM"])
def test_the_tip_is_seen_from_the_camera_through_the_setup_joints(arm):
    rig = Rig(CART).step(2)
    for port, value in rig.sensed.items():
        value[: 6 if "PSM" in port else 4] = 0.0
        if "jaw" not in port:
            value[2] = 0.12
    rig.follows = False
    rig.step(10)
    expected = COMPOSITION["ECM_measured_cp"] if arm == "ECM" else COMPOSITION["PSM_measured_cp"][arm]
    measured = rig.outputs[f"{arm}/measured_cp"]
    assert np.allclose(measured[:3], expected["p"], atol=1e-8)
    assert np.allclose(rotation.matrix(measured[3:]), expected["R"], atol=1e-8)
    local = arms.chain(arm, "400006" if arm != "ECM" else None).forward(
        np.array([0, 0, 0.12, 0, 0, 0])[: 4 if arm == "ECM" else 6]
    )
    assert np.allclose(rig.outputs[f"{arm}/local/measured_cp"][:3], local[:3, 3], atol=1e-12)
    base = rig.outputs[f"SUJ/{arm}/measured_cp"]
    assert np.allclose(base[:3] + rotation.matrix(base[3:]) @ local[:3, 3], measured[:3], atol=1e-12)
    frames = {port.name: port.frame for port in rig.motion.ports}
    assert frames[f"{arm}/measured_cp"] == ("Cart" if arm == "ECM" else "ECM")
    assert frames[f"{arm}/local/measured_cp"] == f"{arm}_base"
    assert frames[f"SUJ/{arm}/measured_cp"] == frames[f"{arm}/measured_cp"]


def test_with_the_frame_of_the_view_the_tip_is_seen_a_quarter_turned_about_the_line_of_sight():
    kinematic, view = (
        Rig({**CART, "ECM": {"tip_frame": frame}}).step(10).outputs["PSM1/measured_cp"]
        for frame in ("kinematic", "view")
    )
    x, y, z = kinematic[:3]
    assert np.allclose(view[:3], [-y, x, z], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("frame", ["", "ECM", "PSM1_base"])
def test_a_pose_is_taken_in_the_frame_it_names(frame):
    rig = Rig(CART).step(10)
    rig.step(1, move_jp=jp(*GOAL)).until_idle().step(10)
    there = rig.outputs["PSM1/local/measured_cp" if frame == "PSM1_base" else "PSM1/measured_cp"].copy()
    rig.step(1, move_jp=jp(*HOME)).until_idle()
    rig.step(1, move_cp=cp(there, frame)).until_idle()
    assert np.allclose(rig.setpoint, GOAL, atol=1e-9)


def test_velocity_wrench_and_jacobians_agree():
    rig = Rig().step(2)
    q, dq = GOAL, np.array([0.1, -0.2, 0.03, 0.4, 0.3, -0.2])
    rig.follows, step = False, 1e-6
    frames = CHAIN.frames(q)
    body = CHAIN.jacobian(frames, frame="tip")
    force = np.array([1.0, -2.0, 0.5, 0.01, 0.02, -0.03])
    rig.sensed["sense/PSM1/measured_js"][:] = [*q, *dq, *(body.T @ force)]
    rig.step(10)
    out = {name.removeprefix("PSM1/"): value for name, value in rig.outputs.items()}
    moved = (CHAIN.forward(q + step * dq) - CHAIN.forward(q - step * dq)) / (2 * step)
    assert np.allclose(out["local/measured_cv"][:3], moved[:3, 3], atol=1e-8)
    assert np.allclose(out["body/measured_cf"], force, atol=1e-9)
    assert np.allclose(out["body/jacobian"].reshape(6, 6), body, atol=1e-12)
    tip = frames[-1]
    spin = moved @ np.linalg.inv(tip)  # the spatial twist as a matrix
    twist = [*spin[:3, 3], spin[2, 1], spin[0, 2], spin[1, 0]]
    assert np.allclose(out["spatial/jacobian"].reshape(6, 6) @ dq, twist, atol=1e-8)
    assert np.isclose(out["spatial/measured_cf"] @ twist, force @ (body @ dq), atol=1e-8)  # the same power


@pytest.mark.parametrize("kind", ["body", "spatial"])
def test_a_wrench_is_applied_through_the_jacobian_wherever_the_arm_goes(kind):
    rig = Rig().step().step(1, **{f"{kind}__servo_cf": cf(0.5, 0.2, -0.4, 0, 0, 0)})
    assert rig.mode == [2, 1]
    rig.follows = False
    rig.sensed["sense/PSM1/measured_js"][:6] = GOAL
    rig.step(10)
    jacobian = rig.outputs[f"PSM1/{kind}/jacobian"].reshape(6, 6)
    expected = np.clip(jacobian.T @ [0.5, 0.2, -0.4, 0, 0, 0], -CHAIN.effort, CHAIN.effort)
    assert np.allclose(rig.outputs["drive/PSM1/servo_jf"], expected, atol=1e-12)


def test_home_that_is_not_reached_is_a_fault():
    rig = Rig(initial_state="disabled").step()
    rig.follows = False
    rig.sensed["sense/PSM1/measured_js"][:6] = HOME + np.array([0.2, 0, 0, 0, 0, 0])
    rig.command("home").step(6000)
    assert rig.states()[-1] == ("FAULT", False, False)
    assert "home not reached" in rig.said("error")[0]
    rig.command("enable")
    assert "accepts disable, unhome" in rig.said("warning")[0]
    assert rig.command("disable").states() == [("DISABLED", False, False)]


def test_restore_returns_to_the_same_bits_in_the_middle_of_a_move():
    rig = Rig().step().step(150, move_jp=jp(*GOAL), jaw__servo_jp=jp(0.5))
    saved, sensed, t = rig.motion.save(), {k: v.copy() for k, v in rig.sensed.items()}, rig.driver.time_ns
    expected = [rig.step().motion.state_hash() for _ in range(400)]
    other = Rig()
    other.motion.restore(saved)
    for name, value in sensed.items():
        other.sensed[name][:] = value
    other.driver.time_ns = t
    assert [other.step().motion.state_hash() for _ in range(400)] == expected
    with pytest.raises(StateError, match="8 bytes"):
        other.motion.restore(bytes(8))


@pytest.mark.parametrize(
    ("arms", "reason"),
    [
        ({}, "name at least one"),
        ({"PSM1": {"instrument": "400999"}}, "no instrument '400999'. Did you mean"),
        ({"PSM1": {"instrument": "400117"}}, "'400117' has a snake wrist"),
        ({"PSM1": {"start": [3, 0, 0.1, 0, 0, 0]}}, r"joint yaw at 3 rad, allowed are -1\.588 \.\. 1\.588"),
        (
            {"PSM1": {"instrument": "420006", "start": [0, 0, 0.1, 0, 1.4, 0]}},
            "joint wrist_pitch at 1.4 rad, allowed are",
        ),
        (
            {"PSM1": {"instrument": "400006", "jaw": 2.0}},
            r"jaw at 2 rad, allowed are -0\.698132 \.\. 1\.39626",
        ),
        ({"PSM1": {"instrument": "palpation-probe", "jaw": 0.1}}, "has no jaw; leave it out"),
        ({"ECM": {"start": [0, 0, 0.3, 0]}}, r"joint insertion at 0\.3 m, allowed are 0 \.\. 0\.255"),
    ],
)
def test_parameters_that_make_no_sense_are_refused(arms, reason):
    with pytest.raises(ValidationError, match=reason):
        MotionParams.model_validate({"arms": arms})


def test_an_encoder_that_is_off_hides_where_the_joint_is_from_the_controller_alone():
    off = np.array([0.044, -0.008, 0.003])
    rig = Rig(joint_errors={"PSM1": off.tolist()})
    true = rig.sensed["sense/PSM1/measured_js"][:6].copy()
    rig.step(10)
    assert rig.outputs["PSM1/measured_js"][:3] == pytest.approx(true[:3] - off, abs=1e-12)
    rig.step(1500, move_jp=jp(*HOME))
    assert rig.outputs["PSM1/measured_js"][:6] == pytest.approx(HOME, abs=1e-9)
    assert rig.outputs["drive/PSM1/servo_jp"][:3] == pytest.approx(HOME[:3] + off, abs=1e-9)
    assert rig.outputs["drive/PSM1/servo_jp"][3:] == pytest.approx(HOME[3:], abs=1e-9)


def test_joint_errors_are_drawn_within_bounds_for_each_arm_and_seed():
    bounds = (0.09, 0.09, 5e-3)
    drawn = [
        tuple(JointErrors(within=bounds, seed=seed).of(arm, 6))
        for seed in range(50)
        for arm in ("PSM1", "PSM2")
    ]
    assert len(set(drawn)) == 100
    assert (np.abs(drawn)[:, :3] <= bounds).all()
    assert (np.abs(drawn).max(axis=0)[:3] > 0.9 * np.array(bounds)).all()
    assert not np.any(np.array(drawn)[:, 3:])
    assert not JointErrors(within=bounds).of("ECM", 4).any()
    with pytest.raises(ValueError, match="bounds are not below 0"):
        JointErrors(within=(-0.1, 0.0, 0.0))
