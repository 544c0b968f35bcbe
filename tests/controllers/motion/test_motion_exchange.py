"""Exchange of an arm's instrument by the motion controller, with a robot that is where it is told to be."""

import numpy as np
import pytest

from controllers.motion.params import MotionParams
from robots.dvrk import psm
from robots.dvrk.instruments import instrument
from schemas.ros import JointState, StringMessage
from tests.controllers.motion.rig import Rig

APPLIER, HOOK = "LARGE_CLIP_APPLIER:400230[..]", "PERMANENT_CAUTERY_HOOK:400183[..]"
ARM = {"PSM1": {"instrument": "400230", "spares": ["400183", "400179"], "start": [0, 0, 0.15, 0, 0.3, 0.2]}}


def rig(**params):
    return Rig(ARM, exchange_time="200 ms", publish_period="1 ms", **params).step(5)


def give(name):
    return StringMessage(data=name)


def insertion(one):
    return one.outputs["drive/PSM1/servo_jp"][2]


def tip_depth(one):
    return -one.outputs["PSM1/local/measured_cp"][2]


def until(one, said, limit=6000):
    """Step until a status with these words."""
    for _ in range(limit):
        one.step()
        if any(said in text for text in one.said("status")):
            return one
    raise AssertionError(f"'{said}' was not said in {limit} steps")


def test_an_arm_draws_back_waits_and_advances_the_next_instrument_to_the_depth_of_the_last_tip():
    one = rig()
    before = tip_depth(one)
    one.step(1, set_tool_type=give(HOOK))
    assert one.states()[-1] == ("ENABLED", True, True)
    until(one, "taken out")
    assert insertion(one) == 0.0
    assert one.outputs["drive/PSM1/instrument"][0] == 0.0
    one.step(150)
    assert one.outputs["drive/PSM1/instrument"][0] == 0.0
    one.step(60)
    assert one.outputs["drive/PSM1/instrument"][0] == 1.0
    until(one, "exchange done")
    assert one.states() == [("ENABLED", True, False)]
    assert tip_depth(one) == pytest.approx(before - 0.005, abs=1e-6)


def test_the_tool_type_is_published_and_kinematics_are_those_of_the_new_instrument():
    one = rig()
    one.step(1, set_tool_type=give("PERMANENT_CAUTERY_HOOK:400183"))
    said = []
    for _ in range(6000):
        one.step()
        said += one.said("tool_type")
        if any("exchange done" in text for text in one.said("status")):
            break
    assert said == [HOOK]
    q = one.outputs["PSM1/measured_js"][:6]
    expected = psm.chain(instrument("400183")).forward(q)
    np.testing.assert_allclose(one.outputs["PSM1/local/measured_cp"][:3], expected[:3, 3], atol=1e-12)


@pytest.mark.parametrize(
    "order",
    [{"move_jp": JointState(position=np.zeros(6))}, {"jaw__move_jp": JointState(position=np.zeros(1))}],
)
def test_an_arm_takes_no_other_command_meanwhile(order):
    one = rig().step(1, set_tool_type=give(HOOK)).step(3, **order)
    assert "exchanges its instrument" in one.said("warning")[0]


def test_a_jaw_that_something_keeps_open_is_not_exchanged():
    one = rig()
    one.follows = False
    one.sensed["sense/PSM1/jaw/measured_js"][0] = 0.1
    one.step(1, set_tool_type=give(HOOK))
    assert "open the jaw" in one.said("error")[0]
    assert one.outputs["drive/PSM1/instrument"][0] == 0.0


@pytest.mark.long
def test_an_instrument_without_a_jaw_refuses_commands_to_the_jaw():
    one = until(rig().step(1, set_tool_type=give(HOOK)), "exchange done")
    one.step(1, jaw__move_jp=JointState(position=np.array([0.3])))
    assert "no jaw" in one.said("warning")[0]
    assert one.outputs["drive/PSM1/control_mode"].tolist() == [1.0, 0.0]
    until(one.step(1, set_tool_type=give(APPLIER)), "exchange done")
    one.step(1, jaw__move_jp=JointState(position=np.array([0.3])))
    assert not one.said("warning")
    assert one.outputs["drive/PSM1/control_mode"].tolist() == [1.0, 1.0]


def test_a_paused_exchange_goes_on_and_a_disabled_one_ends_with_the_old_instrument():
    one = rig().step(100, set_tool_type=give(HOOK))
    one.command("pause", 300)
    held = insertion(one)
    assert 0.0 < held < 0.15
    until(one.command("resume"), "exchange done")
    one.step(100, set_tool_type=give(APPLIER))
    one.command("disable", 3)
    assert any("holds PERMANENT_CAUTERY_HOOK" in text for text in one.said("warning"))
    assert one.outputs["drive/PSM1/instrument"][0] == 1.0


def test_a_restored_controller_goes_on_to_the_bit():
    one = until(rig().step(1, set_tool_type=give(HOOK)), "taken out").step(250)
    state, inputs = one.motion.save(), {name: value.copy() for name, value in one.sensed.items()}
    expected = one.step(400).motion.state_hash()
    other = rig()
    other.motion.restore(state)
    for name, value in inputs.items():
        other.sensed[name][:] = value
    other.driver.t = getattr(one.driver, "t", 0)
    assert other.step(400).motion.state_hash() == expected


@pytest.mark.parametrize(
    ("arm", "said"),
    [
        ({"instrument": "MUSHA_HAND", "spares": ["400183"]}, "cannot be exchanged"),
        ({"instrument": "400230", "spares": ["400230"]}, "twice"),
        ({"instrument": "400230", "spares": ["palpation-probe"]}, "cannot be exchanged"),
        ({"instrument": "400230", "spares": ["40018"]}, "no instrument"),
    ],
)
def test_spares_that_do_not_fit_are_refused(arm, said):
    with pytest.raises(ValueError, match=said):
        MotionParams.model_validate({"arms": {"PSM1": arm}})


def test_an_arm_that_is_not_homed_exchanges_nothing():
    one = Rig(ARM, initial_state="disabled").step(2).step(1, set_tool_type=give(HOOK))
    assert "DISABLED" in one.said("error")[0]


def test_the_instrument_in_use_is_published_and_minus_one_during_an_exchange():
    one = rig()
    assert one.outputs["PSM1/instrument"][0] == 0.0
    one.step(1, set_tool_type=give(HOOK))
    assert one.outputs["PSM1/instrument"][0] == -1.0
    until(one, "taken out")
    assert one.outputs["PSM1/instrument"][0] == -1.0
    until(one, "exchange done")
    assert one.outputs["PSM1/instrument"][0] == 1.0
