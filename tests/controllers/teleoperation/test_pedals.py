"""Pedals beside a hand: power, suction and saline at the held instrument."""

import pytest

import trocar
from tests.controllers.teleoperation.rig import Session

HOOK, APPLIER, SUCKER = "400183", "420327", "SUCTION_IRRIGATOR"
BURNING = """\
name: burning
step: 1 ms
duration: 600 ms
scene:
  looks: false
  mounting: free
  arms:  # 0.9 mm deep
    PSM1: {instrument: '400183', position: [0, 0, 128.3 mm], start: [0, 0, 120 mm, 0, 0, 0], touches: [liver]}
participants:
  stylus:
    kind: simulated-touch
    period: 1 ms
    styluses:
      right:
        path:
          - {at: 0 s}
          - {at: 100 ms, buttons: [1]}
          - {at: 200 ms, buttons: [0, 1]}
          - {at: 400 ms, buttons: [1]}
  teleop: {kind: teleoperation, engage: held, buttons: {pedal: 1, jaw: 2}}
  robot: {kind: mujoco, looks: none}
  tissue:
    kind: fem
    organs: {liver: {size: [30 mm, 30 mm, 8 mm], young_modulus: 5 kPa, nodes: 300}}
order: [teleop, robot, tissue]
connections:
  - stylus.right/pose -> teleop.master
  - stylus.right/buttons -> teleop.buttons
  - robot.PSM1/measured_js -> teleop.measured_js
  - teleop.servo_jp -> robot.PSM1/servo_jp
  - teleop.energy -> tissue.PSM1/energy
"""


def levels(session):
    return {
        name: float(session.outputs[name][0])
        for name in ("energy", "suction", "irrigation")
        if name in session.outputs
    }


def test_the_generator_gives_power_while_the_arm_follows_with_the_pedal_down():
    session = Session(instrument=HOOK, engage="held", power="30 W")
    assert levels(session) == {"energy": 0.0}
    session.step([0, 0, 1, 0])
    assert levels(session) == {"energy": 0.0}, "the arm holds"
    session.step([1, 0, 1, 0], count=3)
    assert levels(session) == {"energy": 30.0}
    session.step([1, 0])
    assert levels(session) == {"energy": 30.0}, "a hand without pedals changes nothing"
    session.step(stale=True)
    assert levels(session) == {"energy": 0.0}, "the hand was lost"
    session.step([1, 0, 0, 1])
    assert levels(session) == {"energy": 0.0}


def test_a_bipolar_jaw_takes_power_and_other_pedals_may_be_named():
    session = Session(instrument="400205", engage="held", buttons={"pedal": 1, "jaw": 2})
    session.step([1, 1])
    assert levels(session) == {"energy": 60.0}


def test_a_suction_irrigator_sucks_and_rinses_by_pedals_of_their_own():
    session = Session(instrument=SUCKER, engage="held")
    session.step([1, 0, 1, 0])
    assert levels(session) == {"suction": 1.0, "irrigation": 0.0}
    session.step([1, 0, 0, 1])
    assert levels(session) == {"suction": 0.0, "irrigation": 1.0}


def test_a_pedal_works_at_the_instrument_that_the_arm_holds():
    arms = {"PSM1": {"instrument": HOOK, "spares": [APPLIER, SUCKER]}}
    session = Session(arms=arms, engage="held")
    session.step([1, 0, 1, 1], arm=("ENABLED", True))
    assert levels(session) == {"energy": 60.0, "suction": 0.0, "irrigation": 0.0}
    session.values["instrument"][0] = -1.0
    session.step()
    assert not any(levels(session).values()), "nothing is in the arm"
    for number, expected in ((1.0, {}), (2.0, {"suction": 1.0, "irrigation": 1.0}), (0.0, {"energy": 60.0})):
        session.values["instrument"][0] = number
        session.step(count=2)
        assert {name: level for name, level in levels(session).items() if level} == expected


def test_pedals_are_part_of_a_saved_state():
    session = Session(instrument=HOOK, engage="held")
    session.step([1, 0, 1, 0])
    saved = session.teleoperation.save()
    session.step([1, 0, 0, 0])
    session.teleoperation.restore(saved)
    session.step()
    assert levels(session) == {"energy": 60.0}


@pytest.mark.parametrize("instrument", ["400006", "palpation-probe"])
def test_other_instruments_have_no_pedal(instrument):
    assert not levels(Session(instrument=instrument))


def test_a_led_hook_heats_tissue_from_the_pedal_to_the_release_of_the_dead_man(tmp_path):
    (tmp_path / "burning.yaml").write_text(BURNING)
    trocar.run(tmp_path / "burning.yaml", record=tmp_path / "run")
    found = trocar.Recording(tmp_path / "run")["tissue.liver/hottest"].messages()
    hottest = {round(t, 3): message.data[0] for t, message in found}
    assert hottest[0.2] == pytest.approx(37.0, abs=0.1), "the pedal alone does nothing"
    assert hottest[0.4] > hottest[0.3] + 5.0 > hottest[0.2] + 10.0
    assert hottest[0.6] < hottest[0.42]
