"""What stands in for the expert in the training scenes: styluses, keys, and programs on ROS."""

import os
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from hub.planning.scenario_file import load
from hub.session.launch import launch, plan_of
from schemas.errors import MissingExtraError
from schemas.scenario import Connection
from tests.devices.ros.dds.test_gateway import domain
from tests.devices.ros.rclpy_environment import rclpy_python
from trocar import run

__all__ = ["domain", "rclpy_python"]

pytest.importorskip("ruckig")
pytestmark = pytest.mark.xdist_group("scene leads")

BARE = {
    "participants.robot.looks": False,
    "participants.endoscope.looks": False,
    "participants.endoscope.period": "200 s",
    "participants.endoscope.host": "hub",
}
PROGRAM = Path(__file__).parents[1] / "examples" / "ros2_psm.py"


@pytest.mark.long
def test_two_hands_at_styluses_lead_both_arms_and_are_scored():
    found = run("peg-board-by-hand", set={**BARE, "duration": "2 s"}, pace="fast", one_host=True).scores[
        "task"
    ]["metrics"]
    assert found["PSM1/path_length"]["value"] > 5e-3
    assert found["PSM2/path_length"]["value"] > 1e-3
    assert found["PSM1/clutch_count"]["value"] == 0  # still led


@pytest.mark.long
def test_keys_lead_the_right_arm(monkeypatch):
    """Somebody gives the window the focus, holds the space bar, and goes to the right."""
    pygame = pytest.importorskip("pygame", reason="needs trocar[keyboard]")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    from devices.keyboard.device import Keyboard

    read, reads = Keyboard.read, []

    def press_and_read(device, now_ns):
        reads.append(now_ns)
        if len(reads) == 3:  # the first one opens the window
            pygame.event.post(pygame.event.Event(pygame.WINDOWFOCUSGAINED))
            for key in ("space", "d"):
                pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.key.key_code(key)))
        return read(device, now_ns)

    monkeypatch.setattr(Keyboard, "read", press_and_read)
    found = run("peg-board-keys", set={**BARE, "duration": "1.5 s"}, pace="realtime", one_host=True)
    metrics = found.scores["task"]["metrics"]
    assert metrics["PSM1/path_length"]["value"] > 1e-3
    assert metrics["PSM1/clutch_count"]["value"] is not None


@pytest.mark.long
def test_the_masters_of_a_recorded_dvrk_lead_an_arm_and_are_scored():
    measure = {"jaw": {"kind": "final", "of": "motion.PSM1/jaw/measured_js.position"}}
    found = run(
        "peg-board-masters",
        set={**BARE, "duration": "3.2 s", "measure": measure},
        pace="fast",
        one_host=True,
    )
    metrics = found.scores["task"]["metrics"]
    assert metrics["PSM1/path_length"]["value"] > 4e-3
    assert metrics["PSM1/clutch_count"]["value"] is not None
    assert found.measures["jaw"] < 0.6  # closed by the gripper


def test_the_masters_of_a_real_dvrk_fit_where_their_recording_is():
    gateway = (
        "participants.lead={kind: ros2-zenoh, host: ros, listen: [MTML, MTMR, footpedals],"
        " namespace: simulation, teleoperations: [MTMR_PSM1, MTML_PSM2]}"
    )
    loaded = load("peg-board-masters", [gateway])
    both = [("console.*", "lead.*"), ("motion.*", "lead.*"), ("lead.*", "motion.*")]
    more = [Connection.model_validate({"source": source, "target": target}) for source, target in both]
    connections = (*loaded.scenario.connections, *more)
    plan, _ = plan_of(loaded.scenario.model_copy(update={"connections": connections}), loaded.params)
    assert {outlet.target_port for outlet in plan.to_devices} >= {"MTMR/move_cp", "PSM1/measured_js"}
    heard = {inlet.source_port for inlet in plan.from_devices}
    assert heard >= {"footpedals/clutch", "MTMR/gripper/measured_js", "MTMR_PSM1/state_command"}


@pytest.mark.parametrize("name", ["peg-board", "peg-board-surrol", "peg-board-fls", "pick-and-place"])
@pytest.mark.parametrize("kind", ["ros2-zenoh", "ros2-dds", "ros1"])
def test_a_gateway_stands_where_the_expert_was(name, kind):
    try:
        plan, _ = plan_of(*_with_gateway(name, kind))
    except MissingExtraError as error:
        pytest.skip(str(error))
    assert "lead" not in plan.order
    sources = {(inlet.source_port, inlet.target_port) for inlet in plan.from_devices}
    assert {("PSM1/servo_cp", "PSM1/servo_cp"), ("PSM2/jaw/servo_jp", "PSM2/jaw/servo_jp")} <= sources


def _with_gateway(name, kind, **params):
    more = "".join(f", {key}: {value}" for key, value in params.items())
    loaded = load(
        name,
        [
            f"participants.lead={{kind: {kind}, host: ros{more}}}",
            "connections.2=endoscope.* -> lead.endoscope/*",
            *(f"{key}={str(value).lower()}" for key, value in BARE.items()),
            "duration=120 s",
        ],
    )
    return loaded.scenario, loaded.params


def test_a_program_on_ros_2_leads_an_arm_of_the_scene(rclpy_python, domain):
    pytest.importorskip("cyclonedds")
    settings = [
        f"participants.lead={{kind: ros2-dds, host: ros, domain: {domain}}}",
        "connections.2=endoscope.* -> lead.endoscope/*",
        "pace=realtime",
        "duration=120 s",
        *(f"{key}={str(value).lower()}" for key, value in BARE.items()),
    ]
    session = launch(load("peg-board-surrol", settings), endpoint="tcp/127.0.0.1:0")
    environment = os.environ | {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}

    def program():
        try:
            return subprocess.run(
                [rclpy_python, PROGRAM],
                env=environment,
                capture_output=True,
                text=True,
                timeout=100,
                check=False,
            )
        finally:
            session.state.shutdown()

    with ThreadPoolExecutor(1) as pool:
        ran = pool.submit(program)
        summary = session.run()
    assert ran.result().returncode == 0, ran.result().stderr
    assert np.isfinite(summary.sim_time_s)
    assert summary.scores["task"]["metrics"]["PSM1/path_length"]["value"] > 0.03
