"""The scenarios in which a real dVRK leads or is mirrored, with the recordings that stand for it; and with a
gateway in their place, as far as wiring goes.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hub.planning.scenario_file import load
from hub.recording.bag import Bag
from hub.session.launch import launch, plan_of
from schemas.scenario import Connection

pytest.importorskip("mujoco")
pytest.importorskip("ruckig")


def run(name, *overrides):
    summary = launch(load(name, list(overrides)), endpoint="tcp/127.0.0.1:0", one_host=True).run()
    assert summary.state == "done"
    return summary.measures


@pytest.mark.long
def test_a_master_leads_an_arm_that_its_console_has_homed():
    """The hand has gone 28 mm to the right by 3.2 s, scaled by 0.2; the jaw closes with the gripper.

    The other hand rests.
    """
    measures = (
        "measure={way: {kind: swing, of: motion.PSM1/measured_cp.position, after: 2.4 s}, jaw: {kind: final,"
        " of: motion.PSM1/jaw/measured_js.position}, other: {kind: swing, of:"
        " motion.PSM2/local/measured_cp.position, after: 2.4 s}}"
    )
    found = run("ros-masters", "duration=3.2 s", measures)
    assert 4.5e-3 < found["way"] < 6.5e-3
    assert found["other"] < 1e-4
    assert found["jaw"] < 0.6


def test_simulated_arms_follow_real_ones_and_say_how_far_behind_they_are():
    found = run("ros-mirror", "duration=1.6 s")
    for arm in ("psm1", "ecm"):
        assert 5e-3 < found[f"{arm}_lag_s"] < 40e-3
        assert found[f"{arm}_largest_distance_m"] < 3e-3


def test_an_arm_that_no_real_one_leads_has_no_lag():
    found = run("ros-mirror", "duration=0.4 s", "participants.real.listen=[PSM1]")
    assert found["psm1_largest_distance_m"] is not None
    assert (found["ecm_lag_s"], found["ecm_largest_distance_m"]) == (None, None)


def test_a_gateway_fits_where_the_recording_of_masters_is():
    gateway = (
        "participants.masters={kind: ros2-zenoh, listen: [MTML, MTMR, footpedals], namespace: simulation,"
        " mounting: cart, teleoperations: [MTMR_PSM1, MTML_PSM2], arms: {PSM1: {instrument: '400006'}, PSM2:"
        " {instrument: '400006'}, ECM: {}}}"
    )
    loaded = load("ros-masters", [gateway])
    back = [{"source": f"{name}.*", "target": "masters.*"} for name in ("console", "motion")] + [
        {"source": "masters.*", "target": "motion.*"}
    ]
    connections = [*loaded.scenario.connections, *(Connection.model_validate(one) for one in back)]
    plan, _ = plan_of(loaded.scenario.model_copy(update={"connections": tuple(connections)}), loaded.params)
    assert {outlet.target_port for outlet in plan.to_devices} >= {
        "MTMR/move_cp",
        "MTMR/body/servo_cf",
        "MTMR_PSM1/current_state",
        "PSM1/measured_js",
    }
    assert {inlet.source_port for inlet in plan.from_devices} >= {
        "footpedals/clutch",
        "MTMR/gripper/measured_js",
        "MTMR_PSM1/state_command",
        "PSM1/servo_jp",
    }


@pytest.mark.parametrize("name", ["ros", "ros-paper"])
def test_what_is_said_of_every_arm_reaches_programs_and_back(name):
    loaded = load(name)
    plan, _ = plan_of(loaded.scenario, loaded.params)
    told = {outlet.target_port for outlet in plan.to_devices}
    heard = {inlet.source_port for inlet in plan.from_devices}
    if name == "ros":
        assert told >= {
            "PSM1/measured_js",
            "SUJ/PSM3/measured_cp",
            "ECM/operating_state",
            "console/teleop/enabled",
            "endoscope/left/image_raw",
        }
        assert heard >= {"PSM3/jaw/servo_jp", "ECM/move_cp", "system/home", "console/emulate_clutch"}
    else:
        assert told >= {
            "dvrk/PSM1/state_joint_current",
            "dvrk/setup_joint/state_joint_current",
            "stereo/right/camera_info",
        }
        assert heard >= {"dvrk/PSM2/state_joint_desired", "dvrk/ECM/state_joint_desired", "release_needle"}


@pytest.mark.long
@pytest.mark.parametrize("name", ["masters", "real_arms"])
def test_the_recordings_are_what_the_example_writes(name, tmp_path):
    root = Path(__file__).parents[1]
    subprocess.run(
        [sys.executable, root / "examples" / "ros_recordings.py", tmp_path],
        check=True,
        cwd=root,
        env={**os.environ, "PYTHONPATH": str(root)},
    )
    written, committed = (
        [
            (message.topic, message.time_ns, bytes(message.payload))
            for message in Bag(directory / name).messages()
        ]
        for directory in (tmp_path, root / "configs" / "data")
    )
    assert written == committed
