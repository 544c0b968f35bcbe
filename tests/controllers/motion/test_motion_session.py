"""The motion controller in a session: three arms and a routine, joined by wildcard connections."""

import pytest

from hub.planning.scenario_file import load
from hub.session.launch import launch
from schemas.errors import ParticipantError

pytest.importorskip("mujoco")
pytest.importorskip("ruckig")

THREE_ARMS = """
name: three_arms
step: 1 ms
duration: 1.5 s
pace: fast
participants:
  routine:
    kind: routine
    steps:
      - do: together
        orders:
          - {do: move_jp, arm: PSM1, positions: [0.1, -0.1, 0.13, 0.5, 0.3, -0.4]}
          - {do: move_jp, arm: PSM2, positions: [-0.1, 0.1, 0.11, -0.5, -0.2, 0.3]}
          - {do: move_jp, arm: ECM, positions: [0.2, 0.2, 0.11, 0]}
          - {do: jaw, arm: PSM1, angle: 30 deg}
  motion:
    kind: motion
    mounting: cart
    initial_state: homed
    arms: &arms
      PSM1: {instrument: "400006"}
      PSM2: {instrument: "400049"}
      ECM: {start: [0.2, 0.3, 100 mm, 0.1]}
  robot: {kind: mujoco, mounting: cart, arms: *arms, looks: false}
order: [routine, motion, robot]
connections:
  - routine.* -> motion.*
  - motion.* -> routine.*
  - motion.drive/* -> robot.*
  - robot.* -> motion.sense/*
measure:
  done: {kind: final, of: routine.done}
"""


@pytest.fixture
def file(tmp_path):
    file = tmp_path / "three_arms.yaml"
    file.write_text(THREE_ARMS)
    return str(file)


def test_wildcards_join_every_arm_both_ways_and_all_reach_their_goals(file):
    session = launch(load(file), endpoint="tcp/127.0.0.1:0", one_host=True)
    summary = session.run()
    assert (summary.state, summary.measures["done"]) == ("done", 1.0)


def test_an_order_out_of_range_ends_the_session_with_the_reason_and_the_range(file):
    bad = "participants.routine.steps=[{do: move_jp, arm: PSM2, positions: [0, 0, 0.5, 0, 0, 0]}]"
    session = launch(load(file, [bad]), endpoint="tcp/127.0.0.1:0", one_host=True)
    with pytest.raises(
        ParticipantError, match=r"PSM2: move_jp refused: joint insertion at 0\.5 m, allowed are 0 \.\. 0\.24"
    ):
        session.run()
