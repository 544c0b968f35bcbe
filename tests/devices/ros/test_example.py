"""The program of docs/ros.md, on real rclpy, against a session with a gateway."""

import os
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from hub.planning.scenario_file import load
from hub.session.launch import launch
from tests.devices.ros.bags.test_bags import SCENARIO
from tests.devices.ros.dds.test_gateway import domain
from tests.devices.ros.rclpy_environment import rclpy_python

__all__ = ["domain", "rclpy_python"]

pytest.importorskip("cyclonedds")
PROGRAM = Path(__file__).parents[3] / "examples" / "ros2_psm.py"


def test_the_program_of_the_documentation_moves_an_arm(rclpy_python, domain, tmp_path):
    gateway = f"{{kind: ros2-dds, domain: {domain}, mounting: cart, arms: *psm, cameras: []}}"
    (tmp_path / "psm.yaml").write_text(
        SCENARIO.format(device=gateway, pace="realtime", duration="120 s") + "  - motion.* -> ros.*\n"
    )
    session = launch(load(str(tmp_path / "psm.yaml")), endpoint="tcp/127.0.0.1:0")
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

    programs = []
    with ThreadPoolExecutor(1) as pool:
        # it waits 20 s for an arm, of which the start of a session is not to take a part
        session.run(lambda _: programs or programs.append(pool.submit(program)))
    ran = programs[0].result()
    assert ran.returncode == 0, ran.stderr
    there, back = ran.stdout.splitlines()
    first, last = (float(line.removeprefix("at [").split(",")[0]) for line in (there, back))
    assert first == pytest.approx(-0.2, abs=0.01)
    assert last == pytest.approx(0.0, abs=0.01)
