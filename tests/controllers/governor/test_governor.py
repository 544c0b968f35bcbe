"""The governor alone: answers become commands within limits, and the arms hold on bad answers."""

import numpy as np
import pytest

from controllers.governor.controller import Condition, Governor
from controllers.governor.params import GovernorParams
from hub.testing import Driver, check_engine
from schemas.crtk import OperatingState
from schemas.ros import Header, Time
from schemas.trocar_msgs import ActionChunk

H = 1_000_000
START = np.array([0.0, 0.0, -0.12, 0.70710678, 0.70710678, 0.0, 0.0])
ARM = {"PSM1": {"instrument": "400006"}}
CONTRACT = {"frame": "base", "rate": 100, "horizon": 10}


class Arm:
    """A governor, and an arm that is where it is commanded to be."""

    def __init__(self, contract=None, **params):
        given = {"arms": ARM, "contract": {**CONTRACT, **(contract or {})}, "execute": 5, **params}
        self.driver = Driver(Governor("governor", GovernorParams.model_validate(given)), period_ns=H)
        self.tip, self.asked, self.said, self.commands = START.copy(), None, [], []
        self.driver.set("PSM1/measured_js", [0.0, 0.0, 0.12, 0, 0, 0, *np.zeros(12)])

    def step(self, times=1, answer=None):
        for _ in range(times):
            self.driver.set("PSM1/measured_cp", self.tip)
            outputs = self.driver.step()
            self.said += [message.data for message in outputs["warning"]]
            for command in outputs.get("PSM1/servo_cp", ()):
                position = command.pose.position
                self.tip[:3] = position.x, position.y, position.z
                self.commands.append(self.tip[:3].copy())
            for asked in outputs["observation"]:
                self.asked = asked
                if answer is not None:
                    self.answer(answer)
        return self

    def answer(self, goal, **fields):
        """Answer the newest observation with ten rows of the tip at a place."""
        rows = np.tile([*goal, *START[3:], 0.3], (10, 1)).ravel()
        asked = self.asked
        given = {
            "header": asked.header,
            "number": asked.number,
            "tips": asked.tips,
            "width": 8,
            "actions": rows,
        }
        self.driver.send("actions", ActionChunk(**{**given, **fields}))

    @property
    def condition(self):
        return Condition(int(self.driver.outputs["condition"][0]))

    def count(self, name):
        return int(self.driver.outputs[name][0])


def test_it_conforms():
    given = {"arms": ARM, "contract": CONTRACT}
    check_engine(lambda: Governor("governor", GovernorParams.model_validate(given)))


def test_the_arm_stays_until_the_policy_answers_and_then_goes_to_the_goal():
    arm = Arm().step(20)
    assert (arm.condition, arm.commands) == (Condition.WAITING, [])
    arm.step(600, answer=[0.02, 0.0, -0.12])
    assert arm.condition is Condition.FOLLOWING
    assert arm.tip[:3] == pytest.approx([0.02, 0.0, -0.12], abs=1e-6)
    assert arm.count("answers") > 3


def test_no_step_is_faster_than_the_limit_and_no_goal_outside_the_workspace():
    arm = Arm(speed="50 mm/s", workspace={"PSM1": [[-0.01, -0.01, -0.13], [0.01, 0.01, -0.11]]})
    arm.step(1000, answer=[0.5, 0.0, -0.5])
    moves = np.linalg.norm(np.diff([START[:3], *arm.commands], axis=0), axis=1)
    assert moves.max() <= 0.05e-3 + 1e-12
    assert arm.tip[:3] == pytest.approx([0.01, 0.0, -0.13], abs=1e-9)
    assert arm.count("limited") > 0


def test_the_policy_is_asked_at_its_rate():
    arm = Arm()
    stamps = []
    for _ in range(200):
        arm.step()
        stamps += [one.header.stamp.ns for one in arm.driver.outputs["observation"]]
    assert np.diff(stamps)[1:].tolist() == [50 * H] * (len(stamps) - 2)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"fault": "the server is away"}, "the server is away"),
        ({"width": 7}, "rows of 7"),
        ({"actions": np.zeros(0)}, "0 numbers"),
        ({"actions": np.zeros(800)}, "1 to 10 rows of 8"),
        ({"tips": np.zeros(0)}, "the contract has"),
        ({"actions": np.zeros(80)}, "quaternion"),
        ({"number": 99}, "another session's?"),
        ({"header": Header(stamp=Time.from_ns(10**12))}, "another session's?"),
    ],
)
def test_a_bad_answer_holds_the_arm_until_a_good_one(fields, said):
    arm = Arm().step(100, answer=[0.02, 0.0, -0.12])
    assert arm.condition is Condition.FOLLOWING
    arm.step(60)
    arm.answer([0.02, 0.0, -0.12], **fields)
    before = len(arm.commands)
    arm.step(2)
    assert (arm.condition, len(arm.commands)) == (Condition.FAULT, before)
    assert any(said in text for text in arm.said)
    assert (arm.count("faults"), arm.count("holds")) == (1, 1)
    arm.step(60, answer=[0.02, 0.0, -0.12])
    assert arm.condition is Condition.FOLLOWING
    assert arm.said[-1] == "the arms follow the policy again"


def test_a_silent_policy_holds_the_arm_after_its_last_row():
    arm = Arm(silence="50 ms").step(60, answer=[0.02, 0.0, -0.12])
    start = arm.driver.time_ns
    while arm.condition is Condition.FOLLOWING:
        arm.step()
    assert arm.condition is Condition.SILENT
    assert 60 * H <= arm.driver.time_ns - start <= 160 * H
    assert "the rows of the last answer ended" in arm.said[-1]


def test_two_answers_that_contradict_each_other_hold_the_arm_until_two_agree():
    arm = Arm(disagreement="5 mm").step(200, answer=[0.0, 0.0, -0.12])
    arm.step(60)
    arm.answer([0.03, 0.0, -0.12])
    arm.step(2)
    assert arm.condition is Condition.DISAGREEMENT
    arm.step(110, answer=[0.03, 0.0, -0.12])
    assert arm.condition is Condition.FOLLOWING


def test_a_late_answer_is_late():
    arm = Arm().step(60)
    arm.step(200)
    old = arm.asked
    arm.driver.time_ns += 0
    arm.step(40)
    arm.asked = old
    arm.answer([0.0, 0.0, -0.12], header=Header(stamp=Time.from_ns(old.header.stamp.ns - 150 * H)))
    arm.step()
    assert (arm.count("late"), arm.condition) == (1, Condition.WAITING)


def test_an_arm_that_is_not_ready_or_pressed_holds():
    arm = Arm(force="2 N").step(100, answer=[0.02, 0.0, -0.12])
    arm.driver.set("PSM1/body/measured_cf", [0.0, 0.0, 3.0, 0, 0, 0])
    arm.step()
    assert arm.condition is Condition.ARM
    assert "meets 3 N" in arm.said[-1]
    arm.driver.set("PSM1/body/measured_cf", [0.0, 0.0, 1.8, 0, 0, 0])
    assert arm.step().condition is Condition.ARM
    arm.driver.set("PSM1/body/measured_cf", [0.0, 0.0, 1.0, 0, 0, 0])
    arm.step(60, answer=[0.02, 0.0, -0.12])
    assert arm.condition is Condition.FOLLOWING
    arm.driver.send("PSM1/operating_state", OperatingState(state="DISABLED"))
    assert arm.step().condition is Condition.ARM
    arm.driver.send("PSM1/operating_state", OperatingState(state="ENABLED", is_homed=True))
    arm.step(60, answer=[0.02, 0.0, -0.12])
    arm.driver.stale("PSM1/measured_cp")
    assert arm.step().condition is Condition.ARM
    assert "is silent" in arm.said[-1]


def test_temporal_ensembling_is_smoother_than_the_newest_answer():
    """Answers that alternate: the mean of all wanders less."""
    ways = []
    for execution in ("receding-horizon", "temporal-ensembling"):
        arm = Arm(execution=execution, execute=1, speed="1 m/s")
        for i in range(60):
            arm.step(10, answer=[2e-3 * (-1) ** i, 0.0, -0.12])
        ways.append(np.abs(np.diff([c[0] for c in arm.commands[200:]])).sum())
    assert ways[1] < 0.5 * ways[0]


def test_joint_goals_stay_in_the_range_and_in_the_workspace():
    arm = Arm(contract={"action": "joint"}, workspace={"PSM1": [[-0.05, -0.05, -0.14], [0.05, 0.05, -0.1]]})
    joints = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.0])
    chain = arm.driver.participant._arms[0].chain
    base = chain.forward(joints)[:3, 3]
    arm.tip = np.array([*base, 0.0, 0.0, 0.0, 1.0])
    for _ in range(400):
        arm.step()
        if arm.driver.outputs["observation"]:
            (asked,) = arm.driver.outputs["observation"]
            rows = np.tile([0.0, 0.0, 0.3, 0, 0, 0, 0.3], (10, 1)).ravel()
            arm.driver.send(
                "actions",
                ActionChunk(header=asked.header, number=asked.number, width=7, actions=rows, tips=asked.tips),
            )
        for command in arm.driver.outputs["PSM1/servo_jp"]:
            joints = command.position
    assert 0.12 < joints[2] < 0.145


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"execute": 11}, "10 \\(contract.horizon\\)"),
        ({"contract": {"arms": ["PSM2"]}}, "PSM2 is no arm of the scene"),
        ({"arms": {"PSM1": {}}}, "holds no instrument with a jaw"),
        ({"workspace": {"PSM2": [[0, 0, 0], [1, 1, 1]]}}, "PSM2 is no arm of the contract"),
    ],
)
def test_parameters_that_do_not_fit_are_refused(change, said):
    with pytest.raises(ValueError, match=said):
        GovernorParams.model_validate({"arms": ARM, "contract": CONTRACT, **change})


def test_a_clip_applier_closes_a_clip_when_its_jaw_is_shut_after_it_was_wide_open():
    given = {"arms": {"PSM1": {"instrument": "420327"}}, "contract": CONTRACT, "execute": 5}
    arm = Arm()
    arm.driver = Driver(Governor("governor", GovernorParams.model_validate(given)), period_ns=H)
    arm.driver.set("PSM1/measured_js", [0.0, 0.0, 0.12, 0, 0, 0, *np.zeros(12)])
    clips = []
    for opening in (0.0, 0.6, np.radians(12.0)):  # as in demonstrations of the routine
        rows = np.tile([*START, opening], (10, 1)).ravel()
        clips.append(0)
        for _ in range(600):
            asked = arm.step().driver.outputs["observation"]
            clips[-1] += len(arm.driver.outputs["PSM1/clip"])
            if asked:
                arm.answer(START[:3], actions=rows)
    assert clips == [0, 0, 1]
    assert "PSM1/clip" not in Arm().step().driver.outputs
