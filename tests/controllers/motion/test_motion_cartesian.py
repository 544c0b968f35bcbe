"""What the motion controller makes of commands to the tip: relative ones, states, wrenches in any axes, base
frames, the cannula.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.motion.setpoint import STREAM_GAP
from robots import rotation
from robots.dvrk import arms
from schemas.ros import BoolMessage, Float64Message
from tests.controllers.motion.rig import CART, EMPTY, HOME, PSM1, Rig, cf, ci, cp, cs, jp

CHAIN = arms.chain("PSM1")
Q = HOME + np.array([0.1, -0.1, 0.02, 0.2, 0.1, -0.1])
TWIST = np.array([0.01, -0.02, 0.005, 0.1, 0.2, -0.1])
FREE = {"mounting": "free", "reference": "world"}
ON, OFF = BoolMessage(data=True), BoolMessage(data=False)


def at(q, arms=PSM1, **params):
    """An arm at `q`, whose tip is told."""
    rig = Rig(arms, **params).step().step(1, move_jp=jp(*q)).until_idle().step(10)
    assert np.allclose(rig.setpoint, q, atol=1e-12)
    return rig


def frame(pose):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation.matrix(pose[3:]), pose[:3]
    return matrix


def tip(rig, kind="setpoint"):
    return frame(rig.step(10).outputs[f"PSM1/{kind}_cp"])


def view(rig):
    """The arm's base frame in its reference."""
    return frame(rig.outputs["SUJ/PSM1/measured_cp"])


class TestServoCr:
    @pytest.mark.parametrize("arms", [PSM1, CART])
    def test_it_shifts_and_turns_the_tip_along_the_axes_of_the_reference(self, arms):
        rig = at(Q, arms)
        before, turn = tip(rig), rotation.exp(np.array([0.02, -0.01, 0.03]))
        after = tip(rig.step(300, servo_cr=cp([0.001, -0.002, 0.0015, *turn])))
        assert np.allclose(after[:3, 3] - before[:3, 3], [0.001, -0.002, 0.0015], atol=1e-9)
        assert np.allclose(after[:3, :3], rotation.matrix(turn) @ before[:3, :3], atol=1e-9)

    def test_it_may_name_the_axes_of_the_base_frame(self):
        rig = at(Q, CART)
        before = tip(rig)
        after = tip(rig.step(300, servo_cr=cp([0.001, 0, 0, 0, 0, 0, 1], "PSM1_base")))
        assert np.allclose(after[:3, 3] - before[:3, 3], 0.001 * view(rig)[:3, 0], atol=1e-9)

    def test_steps_add_up_as_they_come(self):
        rig = at(Q)
        before, step = tip(rig), cp([1e-5, 0, 0, 0, 0, 0, 1])
        for _ in range(100):
            rig.step(1, servo_cr=(step, step))
        assert np.allclose(tip(rig.step(200))[:3, 3] - before[:3, 3], [0.002, 0, 0], atol=1e-9)


class TestServoCs:
    @pytest.mark.parametrize("named", ["", "ECM", "PSM1_base"])
    def test_a_pose_is_followed_as_servo_cp_follows_it(self, named):
        rig, twin = at(HOME, CART), at(HOME, CART)
        goal = frame(np.array([0.005, 0.01, -0.12, *rotation.from_matrix(CHAIN.forward(HOME))]))
        goal = goal if named == "PSM1_base" else view(rig) @ goal
        pose = [*goal[:3, 3], *rotation.from_matrix(goal)]
        for _ in range(50):
            rig.step(1, servo_cs=cs(pose, frame=named))
            twin.step(1, servo_cp=cp(pose, named))
            assert (rig.setpoint == twin.setpoint).all()
        assert not rig.said("error")

    @pytest.mark.parametrize("arms", [PSM1, CART])
    @pytest.mark.parametrize("named", ["", "PSM1_base"])
    def test_a_twist_is_kept_while_it_is_told_and_then_the_arm_stops(self, arms, named):
        rig = at(Q, arms)
        for _ in range(50):
            rig.step(10, servo_cs=cs(twist=TWIST, frame=named))
        velocity = rig.outputs["PSM1/local/setpoint_cv" if named else "PSM1/setpoint_cv"]
        # joint velocities are those of a moment ago
        assert np.allclose(velocity, TWIST, rtol=0.02, atol=1e-4)
        stopped = rig.step(round(1000 * STREAM_GAP) + 100).setpoint
        assert (rig.step(100).setpoint == stopped).all()
        assert not rig.outputs["PSM1/setpoint_cv"].any()

    def test_a_twist_too_fast_for_a_joint_is_slower_as_a_whole(self):
        rig, twist = at(Q), np.array([0.5, 0.0, -0.5, 0.0, 0.0, 0.0])
        for _ in range(150):
            told = np.linalg.solve(CHAIN.jacobian(CHAIN.frames(rig.setpoint)), twist) / CHAIN.velocity
            rig.step(1, servo_cs=cs(twist=twist))
        velocity = rig.outputs["PSM1/setpoint_js"][6:12] / CHAIN.velocity
        assert np.abs(told).max() > 1.5
        assert np.abs(velocity).max() == pytest.approx(1.0)
        assert np.allclose(velocity, told / np.abs(told).max(), atol=0.02)

    def test_a_pose_with_its_twist_is_followed_without_lag(self):
        rig = at(Q)
        start, errors = tip(rig), []
        for k in range(0, 1000, 10):
            angle = 2 * np.pi * 0.5 * (k + 10) * 1e-3
            goal, speed = (
                start[:3, 3] + [0.0, 0.005 * (1 - np.cos(angle)), 0.0],
                0.005 * np.pi * np.sin(angle),
            )
            rig.step(10, servo_cs=cs([*goal, *rotation.from_matrix(start)], [0.0, speed, 0.0, 0.0, 0.0, 0.0]))
            errors.append(np.linalg.norm(CHAIN.forward(rig.setpoint)[:3, 3] - goal))
        assert max(errors[20:]) < 1e-6
        assert not rig.said("error")

    @pytest.mark.parametrize("named", ["", "PSM1_base"])
    def test_a_wrench_is_applied_at_the_tip_along_the_axes_of_its_frame(self, named):
        rig, wrench = at(Q, CART), np.array([0.5, 0.2, -0.4, 0.0, 0.01, 0.0])
        rig.step(1, servo_cs=cs(wrench=wrench, frame=named))
        axes = np.eye(3) if named else view(rig)[:3, :3].T
        jacobian = CHAIN.jacobian(CHAIN.frames(Q))
        expected = jacobian.T @ np.concatenate([axes @ wrench[:3], axes @ wrench[3:]])
        assert rig.mode == [2, 1]
        assert np.allclose(rig.outputs["drive/PSM1/servo_jf"], expected, atol=1e-12)

    def test_nothing_stated_lets_the_arm_go(self):
        rig = at(Q).step(1, servo_cs=cs())
        assert rig.mode == [2, 1]
        assert not rig.outputs["drive/PSM1/servo_jf"].any()


class TestServoCi:
    """The wrench is read off the joint efforts, about a tip that is displaced and moves."""

    def wrench(self, displacement, velocity, **gains):
        """Return what the gains make of a displacement and a velocity, shape (6,), along the axes of the
        goal, along which it is given too.
        """
        rig = at(Q, CART)
        base, chain = view(rig), CHAIN.frames(Q)
        tip = base @ chain[-1]
        axes = tip[:3, :3] @ rotation.matrix(rotation.exp(-np.array(displacement[3:])))
        position = tip[:3, 3] - axes @ displacement[:3]
        rig.follows = False
        body = CHAIN.jacobian(chain)
        turn = base[:3, :3].T @ axes
        rig.sensed["sense/PSM1/measured_js"][6:12] = np.linalg.solve(
            body, [*(turn @ velocity[:3]), *(turn @ velocity[3:])]
        )
        rig.step(1, servo_ci=ci([*position, *rotation.from_matrix(axes)], **gains))
        assert rig.mode == [2, 1]
        assert not rig.said("error")
        effort = np.linalg.solve(body.T, rig.outputs["drive/PSM1/servo_jf"])
        return np.concatenate([turn.T @ effort[:3], turn.T @ effort[3:]])

    def test_each_side_has_its_own_gains(self):
        gains = {
            "position_positive": {
                "p": (-10, -20, -30),
                "d": (-1, -2, -3),
                "bias": (0.1, 0.2, 0.3),
                "deadband": (0.002, 0, 0.02),
            },
            "position_negative": {
                "p": (-40, -50, -60),
                "d": (-4, -5, -6),
                "bias": (-0.1, -0.2, -0.3),
                "deadband": (0, 0.001, -0.003),
            },
        }
        speed = (0.01, 0.01, 0.02, 0, 0, 0)
        up = self.wrench((0.005, 0.004, 0.01, 0, 0, 0), speed, **gains)
        down = self.wrench((-0.005, -0.004, -0.01, 0, 0, 0), speed, **gains)
        assert np.allclose(
            up[:3], [-10 * 0.003 - 0.01 + 0.1, -20 * 0.004 - 0.02 + 0.2, 0.0 - 0.06 + 0.3], atol=1e-9
        )
        assert np.allclose(
            down[:3], [40 * 0.005 - 0.04 - 0.1, 50 * 0.003 - 0.05 - 0.2, 60 * 0.007 - 0.12 - 0.3], atol=1e-9
        )
        assert np.allclose([up[3:], down[3:]], 0.0, atol=1e-9)

    def test_a_rotation_is_resisted_about_the_axes_of_its_goal(self):
        gains = {
            "orientation_positive": {"p": (-0.2, -0.3, 0), "d": (-0.01, 0, 0)},
            "orientation_negative": {"p": (0, -0.1, -0.4)},
        }
        torque = self.wrench((0, 0, 0, 0.1, -0.05, -0.02), (0, 0, 0, 0.3, 0.2, 0.1), **gains)
        assert np.allclose(torque, [0, 0, 0, -0.02 - 0.003, 0.005, 0.008], atol=1e-9)

    def test_it_lasts_until_another_command(self):
        rig = at(Q)
        here, gains = (
            rig.outputs["PSM1/measured_cp"],
            {side: {"p": (-200, -200, -200)} for side in ("position_positive", "position_negative")},
        )
        rig.step(1, servo_ci=ci(here, **gains))
        rig.follows = False
        rig.sensed["sense/PSM1/measured_js"][2] += 0.01
        assert rig.step(100).outputs["drive/PSM1/servo_jf"][2] == pytest.approx(-2.0)
        saved = rig.motion.save()
        rig.step(1, hold=EMPTY)
        assert rig.mode == [1, 1]
        rig.motion.restore(saved)
        assert rig.step(2).outputs["drive/PSM1/servo_jf"][2] == pytest.approx(-2.0)


class TestAbsoluteOrientation:
    def test_a_body_wrench_is_along_the_axes_of_the_reference_and_changes_its_meaning_with_the_switch(self):
        rig, wrench = at(Q, CART), [0.5, 0.2, -0.4, 0, 0, 0.01]
        effort = {}
        for name, switch in {"tip": OFF, "reference": ON}.items():
            rig.step(1, body__servo_cf=cf(*wrench)).step(2, body__set_cf_orientation_absolute=switch)
            effort[name] = rig.outputs["drive/PSM1/servo_jf"].copy()
        as_state = at(Q, CART).step(2, servo_cs=cs(wrench=wrench)).outputs["drive/PSM1/servo_jf"]
        assert np.allclose(effort["reference"], as_state, atol=1e-12)
        assert np.allclose(effort["tip"], CHAIN.jacobian(CHAIN.frames(Q), frame="tip").T @ wrench, atol=1e-12)

    def test_the_measured_wrench_turns_with_it(self):
        rig, force = at(Q, CART), np.array([1.0, -2.0, 0.5, 0.01, 0.02, -0.03])
        rig.follows = False
        rig.sensed["sense/PSM1/measured_js"][12:] = CHAIN.jacobian(CHAIN.frames(Q), frame="tip").T @ force
        assert np.allclose(rig.step(10).outputs["PSM1/body/measured_cf"], force, atol=1e-9)
        rig.step(10, body__set_cf_orientation_absolute=ON)
        axes = frame(rig.outputs["PSM1/measured_cp"])[:3, :3]
        assert np.allclose(
            rig.outputs["PSM1/body/measured_cf"], [*(axes @ force[:3]), *(axes @ force[3:])], atol=1e-9
        )

    def test_it_names_the_frame_that_a_wrench_is_in(self):
        rig = at(Q, CART).step(1, body__set_cf_orientation_absolute=ON)
        rig.step(1, body__servo_cf=cf(*[0.0] * 6, frame="PSM1_tip"))
        assert "frame 'PSM1_tip', allowed are ECM" in rig.said("error")[0]
        assert not rig.step(1, body__servo_cf=cf(*[0.0] * 6, frame="ECM")).said("error")


class TestSetBaseFrame:
    BASE = np.array([0.1, -0.2, 0.3, *rotation.exp(np.array([0.1, 0.5, -0.3]))])

    def test_poses_are_in_the_world_from_where_the_scenario_says_and_then_from_where_a_client_says(self):
        stands = {"PSM1": {"instrument": "400006", "position": [0.5, 0, 0], "orientation": [0, 0, 1, 0]}}
        rig = at(Q, stands, **FREE)
        assert {port.frame for port in rig.motion.ports if port.name == "PSM1/measured_cp"} == {"world"}
        assert np.allclose(tip(rig), frame(np.array([0.5, 0, 0, 0, 0, 1, 0])) @ CHAIN.forward(Q), atol=1e-12)
        rig.step(10, set_base_frame=cp(self.BASE, "world"))
        assert not rig.said("error")
        assert np.allclose(tip(rig, "measured"), frame(self.BASE) @ CHAIN.forward(Q), atol=1e-12)
        assert np.allclose(rig.outputs["SUJ/PSM1/measured_cp"], self.BASE, atol=1e-12)
        assert np.allclose(rig.outputs["PSM1/local/measured_cp"][:3], CHAIN.forward(Q)[:3, 3], atol=1e-12)
        assert (rig.setpoint == Q).all()
        goal = frame(self.BASE) @ CHAIN.forward(HOME)
        rig.step(1, move_cp=cp([*goal[:3, 3], *rotation.from_matrix(goal)])).until_idle()
        assert np.allclose(rig.setpoint, HOME, atol=1e-9)

    def test_it_is_kept_over_a_checkpoint(self):
        rig = at(Q, **FREE).step(10, set_base_frame=cp(self.BASE))
        saved, there = rig.motion.save(), tip(rig)
        rig.step(10, set_base_frame=cp([0, 0, 0, 0, 0, 0, 1]))
        assert not np.allclose(tip(rig), there)
        rig.motion.restore(saved)
        assert np.allclose(tip(rig), there, atol=1e-12)

    @pytest.mark.parametrize(
        ("arms", "params", "named", "reason"),
        [
            (CART, {}, "", "the setup joints determine where the arm stands"),
            (CART, {"reference": "world"}, "", "the setup joints determine where the arm stands"),
            (
                PSM1,
                {"mounting": "free"},
                "",
                "`reference: world` of the motion controller leaves its base frame to clients",
            ),
            (PSM1, FREE, "table", "frame 'table', allowed are world"),
        ],
    )
    def test_where_something_else_says_it_or_nobody_can_tell_the_frame_it_is_refused(
        self, arms, params, named, reason
    ):
        rig = Rig(arms, **params).step()
        before = rig.motion.save()
        rig.step(1, set_base_frame=cp(self.BASE, named))
        assert reason in rig.said("error")[0]
        assert rig.motion._arms["PSM1"]._base.state[0].tobytes() in before

    def test_a_pose_that_is_none_is_refused(self):
        rig = Rig(**FREE).step().step(1, set_base_frame=cp([0, 0, 0, 0, 0, 0, 0]))
        assert "norm 0, allowed is 1" in rig.said("error")[0]


# insertions of a 400006 about where Cartesian control may begin
DEEP, SHALLOW = 0.0156 + 0.0431, 0.0156 + 0.0429
TIP_COMMANDS = {
    "servo_cp": cp([*CHAIN.forward(HOME)[:3, 3], *rotation.from_matrix(CHAIN.forward(HOME))], "PSM1_base"),
    "servo_cr": cp([0, 0, 0, 0, 0, 0, 1]),
    "servo_cs": cs(
        [*CHAIN.forward(HOME)[:3, 3], *rotation.from_matrix(CHAIN.forward(HOME))], frame="PSM1_base"
    ),
    "servo_ci": ci([0, 0, -0.1, 0, 0, 0, 1]),
    "body__servo_cf": cf(*[0.0] * 6),
    "spatial__servo_cf": cf(*[0.0] * 6),
    "move_cp": cp([*CHAIN.forward(HOME)[:3, 3], *rotation.from_matrix(CHAIN.forward(HOME))], "PSM1_base"),
}


def inserted(depth):
    return at(np.array([0.0, 0.0, depth, 0.0, 0.0, 0.0]))


class TestCannula:
    @pytest.mark.parametrize("command", TIP_COMMANDS)
    def test_a_command_to_the_tip_is_heeded_only_past_it(self, command):
        rig = inserted(SHALLOW)
        before, mode = rig.setpoint, rig.mode
        rig.step(20, **{command: TIP_COMMANDS[command]})
        assert (
            "the end of the instrument's shaft is 0.0429 m past the remote centre, allowed from 0.043 on"
            in rig.said("warning")[0]
        )
        assert not rig.said("goal_reached")
        assert (rig.setpoint == before).all()
        assert rig.mode == mode
        assert not inserted(DEEP).step(1, **{command: TIP_COMMANDS[command]}).said("warning")

    def test_a_stream_is_told_once(self):
        rig, told = inserted(SHALLOW), []
        for _ in range(100):
            told += rig.step(1, servo_cp=TIP_COMMANDS["servo_cp"]).said("warning")
        assert len(told) == 1

    def test_an_arm_under_cartesian_control_stays_so_wherever_it_is_pushed_until_it_is_told_otherwise(self):
        rig = inserted(DEEP).step(1, body__servo_cf=cf(*[0.0] * 6))
        rig.follows = False
        rig.sensed["sense/PSM1/measured_js"][2] = 0.03
        assert not rig.step(1, body__servo_cf=cf(0.1, 0, 0, 0, 0, 0)).said("warning")
        rig.step(1, hold=EMPTY)
        assert rig.step(1, body__servo_cf=cf(0.1, 0, 0, 0, 0, 0)).said("warning")

    def test_a_goal_is_not_nearer_to_the_remote_centre_than_is_safe(self):
        rig = inserted(0.12)
        up = CHAIN.forward(np.array([0.0, 0.0, 0.0156 + 0.0449, 0.0, 0.0, 0.0]))
        before = rig.setpoint
        rig.step(1, move_cp=cp([*up[:3, 3], *rotation.from_matrix(up)], "PSM1_base"))
        assert (
            "the end of the instrument's shaft would be 0.0449 m past the remote centre, allowed from"
            " 0.045 on" in rig.said("error")[0]
        )
        assert rig.said("goal_reached") == [False]
        assert (rig.setpoint == before).all()

    def test_where_it_may_begin_the_pose_may_be_held_or_left_but_not_towards_the_remote_centre(self):
        rig = inserted(DEEP)
        here = rig.outputs["PSM1/local/setpoint_cp"]
        for shift, refused in ((0.0, False), (-0.0005, False), (0.0005, True)):
            rig.step(1, servo_cp=cp(here + np.array([0, 0, shift, 0, 0, 0, 0]), "PSM1_base"))
            assert bool(rig.said("error")) is refused

    def test_the_endoscope_is_to_be_50_mm_in_to_begin_and_40_mm_to_go_on(self):
        ecm = {"ECM": {"start": [0, 0, 0.049, 0]}}
        chain, orders = arms.chain("ECM"), {}
        for name, depth in {"deep": 0.1, "shallow": 0.039}.items():
            goal = chain.forward(np.array([0, 0, depth, 0]))
            orders[name] = cp([*goal[:3, 3], *rotation.from_matrix(goal)])
        rig = Rig(ecm, reference="base")
        rig.step().step(1, ECM__servo_cp=orders["deep"])
        assert (
            "the endoscope's insertion is 0.049 m past the remote centre, allowed from 0.05 on"
            in rig.said("warning", "ECM")[0]
        )
        rig.step(1, ECM__move_jp=jp(0, 0, 0.1, 0)).step(5000)
        assert not rig.step(1, ECM__servo_cp=orders["deep"]).said("warning", "ECM")
        rig.step(1, ECM__servo_cp=orders["shallow"])
        assert "allowed from 0.04 on" in rig.said("error", "ECM")[0]


@pytest.mark.parametrize(
    "order",
    [
        {"servo_cr": cp([0.002, 0, 0, 0, 0, 0, 1])},
        {"servo_cs": cs(twist=TWIST)},
        {
            "servo_cs": cs(
                [*CHAIN.forward(Q)[:3, 3], *rotation.from_matrix(CHAIN.forward(Q))], TWIST, frame="PSM1_base"
            )
        },
        {"servo_cs": cs(wrench=[0.1, 0.2, 0.3, 0, 0, 0.01])},
        {
            "servo_ci": ci([0, 0, -0.1, 0, 0, 0, 1], position_positive={"p": (-9, -9, -9)}),
            "body__set_cf_orientation_absolute": ON,
        },
        {"body__servo_cf": cf(0.1, 0.2, 0.3, 0, 0, 0.01), "body__set_cf_orientation_absolute": ON},
        {
            "trajectory_j__set_ratio_v": Float64Message(data=0.3),
            "move_cp": cp([0.01, 0.0, -0.11, 0.70710678, 0.70710678, 0, 0], "PSM1_base"),
        },
    ],
)
def test_a_checkpoint_in_the_middle_of_a_command_to_the_tip_goes_on_to_the_same_bits(order):
    rig, other = Rig().step().step(1, move_jp=jp(*Q)).until_idle().step(4, **order), Rig()
    other.motion.restore(rig.motion.save())
    for name, value in rig.sensed.items():
        other.sensed[name][:] = value
    other.driver.time_ns = rig.driver.time_ns
    assert [other.step().motion.state_hash() for _ in range(200)] == [
        rig.step().motion.state_hash() for _ in range(200)
    ]
    assert not rig.said("error")


@given(st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6))
def test_a_twist_moves_the_tip_as_it_says(shares):
    rig, twist = at(HOME), np.array(shares) * [0.02, 0.02, 0.02, 0.3, 0.3, 0.3]
    rig.step(1, servo_cs=cs(twist=twist)).step(30)
    before = CHAIN.forward(rig.setpoint)
    after = CHAIN.forward(rig.step(1).setpoint)
    spin = rotation.log(rotation.from_matrix(after[:3, :3] @ before[:3, :3].T))
    assert np.allclose(
        np.concatenate([after[:3, 3] - before[:3, 3], spin]) / 1e-3,
        twist,
        atol=0.02 * float(np.linalg.norm(twist))
        + 1e-9,  # of 30 ms in which the joints turn evenly, not the tip
    )
