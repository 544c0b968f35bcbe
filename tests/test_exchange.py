"""An exchange of instruments in a whole session: routine, motion, robot, tissue; and simulated again."""

from pathlib import Path

import numpy as np
import pytest

import trocar
from schemas.ros import Joy, StringMessage

LED = Path(__file__).parent / "webconsole" / "led_exchange.yaml"
SCENARIO = """\
name: exchange
step: 1 ms
duration: 2.6 s
pace: fast
scene:
  arms:
    PSM1:
      instrument: PERMANENT_CAUTERY_HOOK_400183
      spares: [MONOPOLAR_CURVED_SCISSORS_400179]
      position: [0, 0, 150 mm]
      start: [0, 0, 120 mm, 0, 0, 0]
      touches: [slab]
participants:
  routine:
    kind: routine
    steps:
      - {do: exchange, arm: PSM1, instrument: 400179}
      - {do: jaw, arm: PSM1, angle: 40 deg}
      - {do: move_jp, arm: PSM1, positions: [0, 0, 0.145, 0, 0, 0]}
  motion: {kind: motion, initial_state: homed, exchange_time: 50 ms}
  robot: {kind: mujoco, timestep: 1 ms, looks: none}
  tissue:
    kind: fem
    organs:
      slab:
        size: [40 mm, 40 mm, 10 mm]
        nodes: 150
        young_modulus: 20 kPa
        position: [0, 0, -15 mm]
        anchors: [{surface: bottom}]
order: [tissue, routine, motion, robot]
connections:
  - routine.* -> motion.*
  - motion.* -> routine.*
  - motion.drive/* -> robot.*
  - robot.* -> motion.sense/*
"""


@pytest.mark.long
def test_an_arm_gets_scissors_for_its_hook_and_the_session_verifies(tmp_path):
    file = tmp_path / "exchange.yaml"
    file.write_text(SCENARIO)
    trocar.run(file, record=tmp_path / "recording")
    recording = trocar.Recording(tmp_path / "recording")
    said = [message.data for _, message in recording["motion.PSM1/tool_type"].messages()]
    assert said == ["PERMANENT_CAUTERY_HOOK:400183[..]", "MONOPOLAR_CURVED_SCISSORS:400179[..]"]
    held = recording["motion.drive/PSM1/instrument"].values.ravel()
    assert (held[0], held[-1]) == (0.0, 1.0)
    assert trocar.verify(tmp_path / "recording").same


@pytest.mark.long
def test_a_hand_puts_down_what_it_holds_before_it_gets_scissors_and_leads_on(tmp_path):
    """The scenario of the page, with a hand in the session: a grasped block, a refusal, an exchange."""
    text = LED.read_text().replace(
        "{kind: browser, host: remote}", '{kind: "tests.hand_in_session:HandInSession"}'
    )
    text = text.replace("order: [", "order: [hand, ").replace("  - hand.set_tool_type", "  # ")
    (tmp_path / "led.yaml").write_text(text)
    scissors = {"motion.PSM1/set_tool_type": (StringMessage(data="ROUND_TIP_SCISSORS:400007"),)}
    with trocar.SteppedSession(trocar.load_scenario(tmp_path / "led.yaml")) as session:

        def close(opening):
            for asked in np.linspace(1.0 - opening, opening, 200):
                session.advance(1, {"hand.asked": np.array([asked])})
            session.advance(400)

        session.advance(1, {"hand.press": (Joy(buttons=[1, 0]),)})
        close(0.0)
        assert session["robot.block/held_by"][0] == 1.0
        session.advance(1, scissors)
        assert "open the jaw first" in session["motion.PSM1/error"][0].data
        close(1.0)
        session.advance(1, scissors)
        assert session["motion.PSM1/instrument"][0] == -1.0
        session.advance(1)
        assert not session["teleop.following"].data
        while session["motion.PSM1/instrument"][0] < 0.0:
            session.advance(1)
        session.advance(2)
        assert session["motion.PSM1/instrument"][0] == 1.0
        assert session["teleop.following"].data
