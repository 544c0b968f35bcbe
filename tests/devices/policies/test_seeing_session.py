"""Two arms and two pictures in a session: what a server of GR00T-H would see, in the layouts of its data."""

import numpy as np
import pytest

import trocar
from tests.devices.policies.servers import groot_server

pytest.importorskip("ruckig")
pytest.importorskip("mujoco")
pytest.importorskip("zmq")

SCENARIO = """
name: two_arms
step: 1 ms
duration: 0.25 s
pace: fast
scene:
  looks: plain
  arms:
    PSM1: {{instrument: "400006", position: [-60 mm, 0 mm, 200 mm]}}
    PSM2: {{instrument: "400006", position: [60 mm, 0 mm, 200 mm]}}
    ECM: {{position: [0 mm, -126 mm, 180 mm], orientation: [0, -0.30070580, 0.95371695, 0],
           start: [0 deg, 0 deg, 125 mm, 0 deg]}}
  table: {{position: [0 mm, 0 mm, 0 mm], size: [200 mm, 150 mm, 10 mm]}}
  objects: {{needle: {{kind: needle, position: [0 mm, 0 mm, 0.4 mm]}}}}
  contract:
    arms: [PSM1, PSM2]
    action: rel-xyz-rot6d
    rate: 30
    horizon: 10
    instruction: hand over
    cameras:
      endoscope/left: {{width: 64, height: 48}}
      endoscope/right: {{width: 64, height: 48}}
participants:
  policy: {{kind: policy, backend: "{address}", timeout: 30 s}}
  governor: {{kind: governor, execute: 3, execution: temporal-ensembling}}
  motion: {{kind: motion, initial_state: homed}}
  robot: {{kind: mujoco}}
  endoscope: {{kind: endoscope, period: 50 ms, width: 64, height: 48}}
order: [governor, motion, robot, endoscope]
connections:
  - governor.* -> policy.*
  - policy.* -> governor.*
  - governor.* -> motion.*
  - motion.* -> governor.*
  - motion.drive/* -> robot.*
  - robot.* -> motion.sense/*
  - robot.qpos -> endoscope.qpos
  - endoscope.* -> policy.endoscope/*
measure:
  faults: {{kind: final, of: governor.faults}}
  answers: {{kind: final, of: governor.answers}}
"""


def ahead(endpoint, data):
    """Both tips go 1 mm further along their own axes with each row, jaws at 0.2 rad."""
    if endpoint != "get_action":
        return {}
    pose = np.tile(np.array([0, 0, 0, 1, 0, 0, 0, 1, 0], np.float32), (1, 10, 1))
    pose[0, :, 2] = 1e-3 * np.arange(1, 11)
    jaw = np.full((1, 10, 1), 0.2, np.float32)
    return [{"psm1_pose": pose, "psm1_gripper": jaw, "psm2_pose": pose, "psm2_gripper": jaw}, {}]


@pytest.mark.long
@pytest.mark.usefixtures("opengl")
def test_two_arms_are_led_by_what_a_policy_sees_in_the_camera_frame(tmp_path):
    with groot_server(ahead) as (address, seen):
        (tmp_path / "two.yaml").write_text(SCENARIO.format(address=address))
        summary = trocar.run(str(tmp_path / "two.yaml"), record=tmp_path / "recording", one_host=True)
    assert (summary.measures["faults"], summary.measures["answers"] > 0) == (0, True)
    asked = [request["data"]["observation"] for request in seen if request["endpoint"] == "get_action"]
    pictures = asked[0]["video"]
    assert {key: value.shape for key, value in pictures.items()} == {
        "endoscope_left": (1, 1, 48, 64, 3),
        "endoscope_right": (1, 1, 48, 64, 3),
    }
    assert pictures["endoscope_left"].std() > 5, "something is to be seen"
    assert not np.array_equal(pictures["endoscope_left"], pictures["endoscope_right"])
    recording = trocar.Recording(tmp_path / "recording")
    for arm, key in (("PSM1", "psm1_pose"), ("PSM2", "psm2_pose")):
        poses = recording[f"motion.{arm}/measured_cp"]
        assert np.allclose(asked[0]["state"][key][0, 0, :3], poses["position"][0], atol=2e-3)
        way = np.linalg.norm(poses["position"][-1] - poses["position"][0])
        assert 2e-3 < way < 0.1 * 0.25, "they went, within the speed"
    assert trocar.verify(tmp_path / "recording").same
