"""A server's bad days in a session: each is named, the arm holds, the recording is marked and verifies."""

from time import sleep

import numpy as np
import pytest

import trocar
from schemas.errors import ParticipantError
from tests.devices.policies.servers import openpi_server, pack

pytest.importorskip("ruckig")
pytest.importorskip("mujoco")
pytest.importorskip("websockets")

GOAL = [0.01, 0.0, -0.12, 0.70710678, 0.70710678, 0.0, 0.0, 0.3]
SCENARIO = """
name: bad_day
step: 1 ms
duration: 0.3 s
pace: fast
scene:
  arms: {{PSM1: {{instrument: "400006", position: [0 mm, 0 mm, 200 mm]}}}}
  contract: {{frame: base, rate: 100, horizon: 5}}
participants:
  policy: {{kind: policy, backend: "{address}", timeout: 20 s}}
  governor: {{kind: governor, execute: 5, silence: 20 ms}}
  motion: {{kind: motion, reference: base, initial_state: homed, publish_period: 1 ms}}
  robot: {{kind: mujoco, looks: none}}
order: [governor, motion, robot]
connections:
  - governor.* -> policy.*
  - policy.* -> governor.*
  - governor.* -> motion.*
  - motion.* -> governor.*
  - motion.drive/* -> robot.*
  - robot.* -> motion.sense/*
measure:
  faults: {{kind: final, of: governor.faults}}
  holds: {{kind: final, of: governor.holds}}
outcome:
  text: "{{faults}} faults"
  success: {{faults: {{most: 0}}}}
"""


def run(directory, address, **values):
    file = directory / "bad_day.yaml"
    file.write_text(SCENARIO.format(address=address))
    return trocar.run(str(file), set=values, record=directory / "recording", one_host=True)


def good(rows=5):
    return pack({"actions": np.tile(GOAL, (rows, 1))})


def die(connection):
    connection.socket.shutdown(2)


BAD = {
    "text": (lambda c: "Traceback: no GPU", "reports an error: Traceback: no GPU"),
    "not a number": (lambda c: pack({"actions": np.full((5, 8), np.inf)}), "not finite"),
    "shape": (lambda c: pack({"actions": np.zeros((5, 9))}), "shape (5, 9)"),
    "too large": (lambda c: bytes(2**26 + 1), "has gone"),
    "dies": (die, "has gone"),
    "no quaternion": (lambda c: pack({"actions": np.zeros((5, 8))}), "no direction can be read"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_answer_holds_the_arm_and_marks_the_recording(tmp_path, case):
    bad, named = BAD[case]

    def answer(observation, connection):
        answers.append(1)
        return bad(connection) if len(answers) == 3 else good()

    answers = []
    with openpi_server(answer) as (address, _):
        summary = run(tmp_path, address)
    assert summary.measures["faults"] >= 1
    assert summary.measures["holds"] == 1
    recording = trocar.Recording(tmp_path / "recording")
    warnings = [(t, message.data) for t, message in recording["governor.warning"].messages()]
    held_s = next(t for t, text in warnings if "the arms hold: the last answer is invalid" in text)
    assert any(named in text for _, text in warnings), warnings
    diagnoses = [m.message for _, m in recording["policy.diagnostics"].messages()]
    assert case == "no quaternion" or any(named in text for text in diagnoses), diagnoses
    commanded = [t for t, _ in recording["governor.PSM1/servo_cp"].messages()]
    assert not [t for t in commanded if held_s <= t < held_s + 0.04], "the next answer comes 50 ms later"
    assert trocar.verify(tmp_path / "recording").same


def test_a_server_that_is_away_is_named_and_the_arm_stays(tmp_path):
    with openpi_server(lambda *_: good()) as (address, _):
        pass
    summary = run(tmp_path, address)
    assert summary.measures["faults"] >= 1
    recording = trocar.Recording(tmp_path / "recording")
    assert not list(recording["governor.PSM1/servo_cp"].messages())
    assert any("cannot be reached" in m.message for _, m in recording["policy.diagnostics"].messages())


def test_a_delay_of_the_network_link_is_in_simulated_time(tmp_path):
    """Observation and answer travel 30 ms each: rows of 50 ms are half past."""
    with openpi_server(lambda *_: good()) as (address, _):
        summary = run(tmp_path, address, **{"participants.policy.network_link": {"delay": "30 ms"}})
    assert summary.measures["faults"] == 0
    recording = trocar.Recording(tmp_path / "recording")
    chunks = list(recording["policy.actions"].messages())
    assert {round(1e3 * t - 1e-6 * m.header.stamp.ns) for t, m in chunks} <= {60, 61, 62}
    assert trocar.verify(tmp_path / "recording").same


@pytest.mark.long
def test_answers_in_wall_time_enter_when_they_come(tmp_path):
    with openpi_server(lambda *_: good()) as (address, _):
        values = {"pace": "realtime", "duration": "1.5 s", "participants.policy.time": "wall"}
        summary = run(tmp_path, address, **values)
    recording = trocar.Recording(tmp_path / "recording")
    assert list(recording["policy.actions"].messages())
    assert summary.measures["faults"] == 0
    assert trocar.verify(tmp_path / "recording").same


def test_a_contract_that_the_server_contradicts_ends_the_session_at_its_start(tmp_path):
    with (
        openpi_server(lambda *_: good(), {"contract": {"rate": 30.0}}) as (address, _),
        pytest.raises(ParticipantError, match=r"rate: the policy has 30\.0, the contract 100\.0"),
    ):
        run(tmp_path, address)


@pytest.mark.long
def test_answers_that_are_late_are_late(tmp_path):
    """An answer of 50 ms of rows comes after a second: none of them is executed."""

    def late(observation, connection):
        sleep(1.0)
        return good()

    with openpi_server(late) as (address, _):
        values = {"pace": "realtime", "duration": "3 s", "participants.policy.time": "wall"}
        run(tmp_path, address, **values)
    recording = trocar.Recording(tmp_path / "recording")
    assert recording["governor.late"]["data"][-1] >= 1
    assert recording["governor.answers"]["data"][-1] == 0
    assert not list(recording["governor.PSM1/servo_cp"].messages())
