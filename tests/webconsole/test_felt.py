"""Which force the hand at a page feels."""

from pathlib import Path

from hub.planning.scenario_file import load
from schemas.scenario import Scenario
from webconsole.felt import felt_wrenches

WRENCHES = ("robot.PSM1/tip_wrench", "robot.PSM2/tip_wrench", "robot.PSM1/measured_cp")


def test_it_is_on_the_instrument_that_the_hand_moves():
    assert felt_wrenches(load(str(Path(__file__).parent / "led_arm.yaml"), []).scenario, WRENCHES) == {
        "hand": (WRENCHES[0],)
    }
    assert felt_wrenches(load("palpation", []).scenario, WRENCHES) == {}


def test_two_hands_feel_an_arm_each():
    """Through one controller of both arms, whose state goes back to those of each hand."""
    kinds = {"right": "browser", "left": "browser", "motion": "motion", "robot": "mujoco"}
    kinds |= dict.fromkeys(("a", "b"), "teleoperation")
    scenario = Scenario.model_validate(
        {
            "name": "two_hands",
            "step": "1 ms",
            "participants": {name: {"kind": kind} for name, kind in kinds.items()},
            "connections": [
                "right.pose -> a.master",
                "left.pose -> b.master",
                "a.PSM1/servo_jp -> motion.PSM1/servo_jp",
                "b.PSM2/servo_jp -> motion.PSM2/servo_jp",
                "motion.PSM1/setpoint_js -> a.measured_js",
                "motion.PSM2/setpoint_js -> b.measured_js",
                "motion.drive/* -> robot.*",
                "robot.* -> motion.sense/*",
            ],
        }
    )
    assert felt_wrenches(scenario, WRENCHES) == {"right": (WRENCHES[0],), "left": (WRENCHES[1],)}


def test_a_pair_of_hands_on_masters_feels_each_master():
    pair = ["participants.lead={kind: browser-pair, host: remote}"]
    felt = ("robot.MTML/hand_cf", "robot.MTMR/hand_cf", "robot.PSM1/tip_wrench")
    assert felt_wrenches(load("system", pair).scenario, felt) == {
        "lead/right": (felt[1],),
        "lead/left": (felt[0],),
    }
