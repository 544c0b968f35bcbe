"""A session with a gateway to ROS 1: a client of CRTK on rospy enables, homes and moves an arm, and nothing
moves that should not.
"""

from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from time import sleep

import numpy as np
import pytest

from devices.ros.ros1.gateway import Ros1Gateway
from hub.planning.wiring import make_plan
from hub.session.session import Session
from schemas.scenario import Scenario
from tests.devices.ros.ideal_robot import IdealRobot, motion
from tests.devices.ros.rospy_peer import Program, master, needs_rospy
from tests.waiting import until

pytest.importorskip("ruckig")
pytestmark = [pytest.mark.ros, needs_rospy]

ARMS = {"PSM1": {"instrument": "400006"}}
HOME = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.0])


@contextmanager
def session(ros, directory):
    """Run a session in another thread, and a console in a process of its own that is there before it."""
    controller = motion(arms=ARMS, mounting="cart")
    params = {"master": ros.uri, "arms": ARMS, "mounting": "cart", "publish_period": "5 ms", "cameras": []}
    gateway = Ros1Gateway("ros", Ros1Gateway.params_model.model_validate(params))
    connections = [
        "motion.drive/* -> robot.*",
        "robot.* -> motion.sense/*",
        "motion.* -> ros.*",
        "ros.* -> motion.*",
    ]
    participants = {"motion": controller, "robot": IdealRobot(controller), "ros": gateway}
    kinds = {name: {"kind": type(participant).__name__} for name, participant in participants.items()}
    scenario = Scenario.model_validate(
        {
            "name": "ros_1",
            "step": "2 ms",
            "pace": "realtime",
            "order": ["motion", "robot"],
            "participants": kinds,
            "connections": connections,
        }
    )
    plan = make_plan(scenario, participants, {"motion": "controller", "robot": "engine", "ros": "device"})
    it = Session(scenario, plan, participants, directory, endpoint="tcp/127.0.0.1:0")
    with Program(ros) as console, ThreadPoolExecutor(1) as pool:
        assert console.arm("PSM1", "connected", 0.0) is False
        run = pool.submit(it.run)
        try:
            yield console
        finally:
            it.state.shutdown()
            run.result()


def test_a_client_enables_homes_and_moves_an_arm(tmp_path):
    with master(tmp_path) as ros, session(ros, tmp_path) as console:
        assert console.arm("PSM1", "connected")
        console.listen("/PSM1/warning", "std_msgs/msg/String")
        console.arm("PSM1", "servo_jp", list(HOME + 0.1))  # to an arm that is disabled
        assert "servo_jp refused" in console.heard("/PSM1/warning", 60.0)["data"]
        console.arm("PSM1", "enable")
        console.arm("PSM1", "home")
        edges = console.arm("PSM1", "edges")
        assert ["ENABLED", False, True] in edges, "homing is busy"
        console.arm("PSM1", "move_jp", list(HOME + 0.02))
        assert until(lambda: np.allclose(console.arm("PSM1", "positions"), HOME + 0.02, atol=1e-6))
        for _ in range(20):
            console.arm("PSM1", "move_jp", list(HOME + 0.02))  # nothing to move, and yet busy and then idle
        console.arm("PSM1", "disable")
        console.arm("PSM1", "servo_jp", list(HOME))
        sleep(0.1)
        assert np.allclose(console.arm("PSM1", "positions"), HOME + 0.02, atol=1e-6)
