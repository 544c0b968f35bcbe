import numpy as np
import pytest
from pydantic import ValidationError

from controllers.motion.controller import MotionController
from controllers.motion.params import MotionParams
from controllers.routine import RoutineParams
from hub.testing import check_engine
from robots.dvrk import arms
from robots.dvrk.end_effectors.musha import HAND
from tests.controllers.motion.rig import H, Rig, cp, jf, jp

ARM = {"PSM1": {"instrument": "MUSHA_HAND"}}
OPEN = HAND.command("caliper", 0.0)


def closings(rig):
    return rig.outputs["drive/PSM1/hand/servo_jp"].copy()


def test_the_contract_of_participants_is_kept():
    params = MotionParams.model_validate({"arms": ARM, "initial_state": "homed"})
    check_engine(
        lambda: MotionController("motion", params), period_ns=H, inputs={"PSM1/hand/move_jp": (jp(*OPEN),)}
    )


def test_a_hand_moves_while_the_arm_does():
    rig = Rig(ARM).step(hand__move_jp=jp(*OPEN), move_jp=jp(0.1, 0.0, 0.13, 0.2))
    rig.until_idle()
    assert np.allclose(closings(rig), OPEN)
    assert np.allclose(rig.setpoint, [0.1, 0.0, 0.13, 0.2])


def test_a_hand_follows_a_stream():
    rig = Rig(ARM)
    for i in range(200):
        rig.step(hand__servo_jp=jp(*(-1e-3 * i * np.ones(6))))
    assert np.allclose(closings(rig), -0.199, atol=0.005)


def test_fingers_may_be_told_to_pull():
    rig = Rig(ARM).step(hand__servo_jf=jf(0.1, 0.1, 0.0, 0.0, 0.0, 0.0))
    assert rig.mode == [1, 2]
    assert rig.outputs["drive/PSM1/hand/servo_jf"].tolist() == [0.1, 0.1, 0.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("order", "reason"),
    [
        ({"hand__move_jp": jp(0.0, 0.0)}, "expected 6: finger1, finger2, finger3, spread1, spread2, spread3"),
        ({"hand__servo_jp": jp(4.0, *[0.0] * 5)}, "finger1 at 4 rad, allowed are"),
        ({"hand__servo_jf": jf(1.0, *[0.0] * 5)}, "finger1 at 1 N m, allowed are"),
        ({"move_jp": jp(0, 0, 0.12, 0, 0, 0)}, "expected 4: yaw, pitch, insertion, roll"),
    ],
)
def test_what_a_hand_cannot_do_is_refused_with_what_is_allowed(order, reason):
    rig = Rig(ARM)
    before = closings(rig)
    assert reason in rig.step(**order).said("error")[0]
    assert np.array_equal(closings(rig), before)


def test_a_pose_of_the_tip_is_reached_as_far_as_four_joints_go():
    chain, rig = arms.chain("PSM1", "MUSHA_HAND"), Rig(ARM)
    tip = chain.forward(np.array([0.1, -0.1, 0.13, 0.3]))[:3, 3]
    rig.step(move_cp=cp([*tip, 0.70710678, 0.70710678, 0.0, 0.0], "PSM1_base"))
    rig.until_idle()
    assert np.allclose(chain.forward(rig.setpoint)[:3, 3], tip, atol=1e-9)
    assert (
        "four joints leave" in rig.step(move_cp=cp([*tip, 0.0, 0.0, 0.0, 1.0], "PSM1_base")).said("error")[0]
    )


def test_a_start_that_is_not_that_of_the_arm_is_refused():
    with pytest.raises(ValidationError, match="expected 4"):
        MotionParams.model_validate({"arms": {"PSM1": {**ARM["PSM1"], "start": [0, 0, 0.12, 0, 0, 0]}}})


def test_a_routine_names_the_mode():
    (step,) = RoutineParams.model_validate(
        {"steps": [{"do": "hand", "arm": "PSM1", "mode": "caliper", "closing": 0.4}]}
    ).steps
    port, message = step.message()
    assert port == "PSM1/hand/move_jp"
    assert np.allclose(message.position, HAND.command("caliper", 0.4))
    with pytest.raises(ValidationError, match="closing"):
        RoutineParams.model_validate(
            {"steps": [{"do": "hand", "arm": "PSM1", "mode": "grasp", "closing": 2}]}
        )
