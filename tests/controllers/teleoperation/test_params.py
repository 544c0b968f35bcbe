"""A teleoperation leads what the arms of the scenario hold."""

import pytest
from pydantic import ValidationError

from controllers.teleoperation.params import TeleoperationParams
from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from robots.dvrk import psm

HAND = {"PSM1": {"instrument": "400006"}, "PSM2": {"instrument": "MUSHA_HAND", "start": [0, 0, 0.1, 0]}}

SCENARIO = """\
name: led
step: 1 ms
duration: 3 ms
pace: fast
scene:
  arms:
    PSM1: {instrument: 400006, start: [0.1, 0, 140 mm, 0, 0, 0]}
    PSM2: {instrument: palpation-probe, probe_radius: 4 mm}
    ECM: {}
participants:
  stylus: {kind: simulated-touch, styluses: {right: {path: [{at: 0 s, position: [0, 0, 0]}]}}}
  one: {kind: teleoperation}
  two: {kind: teleoperation, arm: PSM2}
  robot: {kind: mujoco, looks: false}
order: [one, two, robot]
connections:
  - stylus.right/pose -> one.master
  - stylus.right/pose -> two.master
  - one.servo_jp -> robot.PSM1/servo_jp
  - two.servo_jp -> robot.PSM2/servo_jp
"""


def params(**given):
    return TeleoperationParams.model_validate(given)


def test_the_instrument_is_what_the_led_arm_holds():
    assert params(arms=HAND).instrument == "LARGE_NEEDLE_DRIVER_400006"
    led = params(arms=HAND, arm="PSM2")
    assert led.instrument == "MUSHA_HAND"
    assert led.start == psm.home(led.tool)  # the start of the arm itself is measured


def test_without_arms_it_is_a_probe_unless_it_is_stated():
    assert params().instrument == "palpation-probe"
    assert params(instrument="400006").instrument == "LARGE_NEEDLE_DRIVER_400006"


def test_it_may_be_stated_twice_and_in_two_ways():
    assert params(arms=HAND, instrument="LARGE_NEEDLE_DRIVER_400006") == params(arms=HAND)
    assert params(arms={"ECM": {}}, instrument="400006").tool.jaw is not None


def test_an_instrument_that_the_arms_contradict_is_refused():
    message = (
        "instrument 'palpation-probe', but in `arms` PSM1 holds 'LARGE_NEEDLE_DRIVER_400006'; state it once,"
        " in `arms`"
    )
    with pytest.raises(ValidationError, match=message):
        params(arms=HAND, instrument="palpation-probe")


def test_a_led_arm_that_is_not_there_is_refused():
    with pytest.raises(ValidationError, match="`arms` has PSM1, PSM2 and not PSM3, which the hand leads"):
        params(arms=HAND, arm="PSM3")


def test_what_is_written_out_is_read_again():
    led = params(arms=HAND, arm="PSM2")
    assert TeleoperationParams.model_validate(led.model_dump(mode="json")) == led


@pytest.mark.parametrize("stated", ["", ", instrument: 400006"])
def test_a_scene_states_the_instruments_of_all_and_a_recording_has_them(stated, tmp_path):
    pytest.importorskip("mujoco")
    file = tmp_path / "led.yaml"
    file.write_text(SCENARIO.replace("one: {kind: teleoperation", f"one: {{kind: teleoperation{stated}"))
    loaded = load(str(file))
    held = {name: loaded.params[name].instrument for name in ("one", "two")}
    assert held == {"one": "LARGE_NEEDLE_DRIVER_400006", "two": "palpation-probe"}
    assert launch(loaded, record=tmp_path / "recording").run().state == "done"
    recorded = Recording(tmp_path / "recording").scenario()
    assert recorded == loaded.scenario
    again = {name: TeleoperationParams.model_validate(recorded.participants[name].params) for name in held}
    assert {name: params.instrument for name, params in again.items()} == held
