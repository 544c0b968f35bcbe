"""A hand picks a needle up: down, close the jaw by the second button, up; friction alone holds it."""

import pytest

from hub.planning.scenario_file import load
from hub.session.launch import launch

pytest.importorskip("mujoco")

SCENARIO = """
name: pick_by_hand
step: 2 ms
duration: 2 s
pace: fast
scene:
  # As in the scenario `pick` the arm starts 19.5 mm above the needle: the tip at [60, 0, -170] mm of its
  # base, pointing down.
  arms:
    PSM1:
      instrument: "400006"
      position: [-60 mm, 0 mm, 200 mm]
      jaw: 15 deg
      start: [0.3392926, 0, 186.77756 mm, 0, 0, -0.3392926]
participants:
  stylus:
    kind: simulated-touch
    styluses:
      right:
        path:
          - {at: 0 s, position: [0 mm, 0 mm, 0 mm], buttons: [0]}
          - {at: 0.5 s, position: [0 mm, 0 mm, -39 mm]}
          - {at: 0.6 s, buttons: [0, 1]}
          - {at: 1.4 s}
          - {at: 1.8 s, position: [0 mm, 0 mm, 1 mm]}
  teleop: {kind: teleoperation, engage: held, scale: 0.5}
  robot:
    kind: mujoco
    table: {position: [0 mm, 0 mm, 0 mm], size: [200 mm, 150 mm, 10 mm]}
    objects:
      needle: {kind: needle, position: [11.44 mm, 0 mm, 0.4 mm], orientation: [0, 0, 1, 0]}
    looks: false
    publish_period: 2 ms
order: [teleop, robot]
connections:
  - stylus.right/pose -> teleop.master
  - stylus.right/buttons -> teleop.buttons
  - teleop.servo_jp -> robot.PSM1/servo_jp
  - teleop.jaw/servo_jp -> robot.PSM1/jaw/servo_jp
  - robot.PSM1/measured_js -> teleop.measured_js
  - robot.PSM1/jaw/measured_js -> teleop.jaw/measured_js
measure:
  lift_m: {kind: final, of: robot.needle/lift, unit: m}
  held_by: {kind: final, of: robot.needle/held_by}
"""


def test_a_needle_is_picked_up_with_a_stylus(tmp_path):
    file = tmp_path / "pick_by_hand.yaml"
    file.write_text(SCENARIO)
    summary = launch(load(str(file)), endpoint="tcp/127.0.0.1:0", one_host=True).run()
    assert summary.measures["held_by"] == 1.0
    assert 0.018 < summary.measures["lift_m"] < 0.026
