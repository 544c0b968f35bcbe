"""The same governor before a real arm: another session, behind ROS 2, stands in for the dVRK."""

import os
import shutil
import subprocess
import sys

import pytest

import trocar
from hub.planning.scenario_file import installed_scenarios
from tests.waiting import LIMIT_S

pytest.importorskip("ruckig")
pytest.importorskip("mujoco")
pytest.importorskip("cyclonedds")

DOMAIN = 60 + os.getpid() % 40
DVRK = f"""
name: dvrk_{os.getpid()}
step: 2 ms
pace: realtime
scene: {{arms: {{PSM1: {{instrument: "400006", position: [0 mm, 0 mm, 200 mm]}}}}}}
participants:
  motion: {{kind: motion, initial_state: homed, reference: base, publish_period: 4 ms}}
  robot: {{kind: mujoco, looks: none, publish_period: 20 ms}}
  ros: {{kind: ros2-dds, reference: base, domain: {DOMAIN}}}
order: [motion, robot]
connections:
  - ros.* -> motion.*
  - motion.* -> ros.*
  - motion.drive/* -> robot.*
  - robot.* -> motion.sense/*
"""


@pytest.fixture
def dvrk(tmp_path):
    (tmp_path / "dvrk.yaml").write_text(DVRK)
    command = [sys.executable, "-P", "-m", "trocar", "run", str(tmp_path / "dvrk.yaml")]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    yield
    process.terminate()
    process.wait(LIMIT_S)


@pytest.mark.long
def test_a_policy_leads_an_arm_behind_ros_within_the_governors_limits(dvrk, tmp_path):
    own = installed_scenarios()["policy"].parent / "data" / "policies" / "pick.py"
    shutil.copy(own, tmp_path / "pick.py")
    shutil.copy(installed_scenarios()["ros-policy"], tmp_path / "ros-policy.yaml")
    values = {
        "participants.policy.backend": "python:pick.py:Pick",
        "participants.real.kind": "ros2-dds",
        "participants.real.domain": DOMAIN,
        "participants.governor.workspace": {"PSM1": [[-0.04, -0.04, -0.13], [0.04, 0.04, -0.09]]},
        "duration": "12 s",  # the other session takes seconds to start
    }
    summary = trocar.run(str(tmp_path / "ros-policy.yaml"), set=values, record=tmp_path / "recording")
    assert summary.measures["faults"] == 0
    heights = trocar.Recording(tmp_path / "recording")["real.PSM1/measured_cp"]["position"][:, 2]
    assert heights.min() < heights[0] - 0.005, "it went down"
    assert heights.min() > -0.1305, "to the wall of the workspace"
    assert trocar.verify(tmp_path / "recording").same
