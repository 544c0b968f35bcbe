"""The console and the authors' topics in sessions with a gateway in memory: what programs say goes through to
arms that are at once where they are told.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from time import monotonic, sleep
from typing import Any

import numpy as np
import pytest

from controllers.dvrk_console.controller import DvrkConsole
from controllers.dvrk_console.params import DvrkConsoleParams
from controllers.vrep import VrepScene, VrepSceneParams
from devices.ros.params import GatewayParams
from hub.participant import Stepped
from hub.testing import run_in_process
from schemas.ros import BoolMessage, EmptyMessage, JointState, StringMessage
from tests.devices.ros.ideal_robot import IdealRobot, motion
from tests.devices.ros.memory import MemoryGateway, MemoryTransport

pytest.importorskip("ruckig")

ARMS = {"PSM1": {"instrument": "400006"}, "PSM2": {"instrument": "400006"}}


def play(
    participants: dict[str, Stepped],
    gateway: MemoryGateway,
    connections: list[str],
    programs: Callable[[MemoryTransport], None],
) -> None:
    """Run a session of 3 s at most in another thread, and let `programs` speak."""
    scenario = {
        "name": "programs",
        "step": "2 ms",
        "duration": "3 s",
        "pace": "realtime",
        "order": list(participants),
        "connections": connections,
    }
    with ThreadPoolExecutor(1) as pool:
        run = pool.submit(run_in_process, scenario, {**participants, "ros": gateway})
        while not hasattr(gateway, "transport"):
            assert not run.done(), run.result()
            sleep(0.01)
        try:
            programs(gateway.transport)
        finally:
            run.result()  # the session's own error says more than what was not heard


def until(heard: Callable[[], list[Any]], holds: Callable[[Any], bool]) -> None:
    end = monotonic() + 120.0
    while not any(holds(message) for message in heard()):
        assert monotonic() < end, heard()[-3:]
        sleep(0.003)


def test_a_program_homes_all_arms_by_the_console_and_reads_what_the_console_says_though_it_joins_late() -> (
    None
):
    controller = motion(arms=ARMS, mounting="cart")
    console = DvrkConsole(
        "console",
        DvrkConsoleParams.model_validate({"arms": ["PSM1", "PSM2"], "teleoperations": ["MTMR_PSM1"]}),
    )
    gateway = MemoryGateway(
        "ros",
        GatewayParams.model_validate({"arms": ARMS, "mounting": "cart", "teleoperations": ["MTMR_PSM1"]}),
    )

    def programs(transport: MemoryTransport) -> None:
        until(lambda: transport.heard("/console/teleop/enabled"), lambda told: not told.data)
        until(lambda: transport.heard("/MTMR_PSM1/current_state"), lambda told: told.data == "DISABLED")
        transport.send("/system/home", EmptyMessage())
        for arm in ARMS:
            until(
                lambda arm=arm: transport.heard(f"/{arm}/operating_state"),
                lambda state: state.is_homed and not state.is_busy,
            )
        transport.send("/console/teleop/enable", BoolMessage(data=True))
        until(lambda: transport.heard("/MTMR_PSM1/current_state"), lambda told: told.data == "ALIGNING_MTM")
        transport.send("/system/power_off", EmptyMessage())
        until(lambda: transport.heard("/PSM2/operating_state")[-1:], lambda state: state.state == "DISABLED")

    joined = [
        "motion.drive/* -> robot.*",
        "robot.* -> motion.sense/*",
        "motion.* -> ros.*",
        "ros.* -> motion.*",
    ]
    joined += ["ros.* -> console.*", "console.* -> ros.*", "console.* -> motion.*", "motion.* -> console.*"]
    play(
        {"console": console, "motion": controller, "robot": IdealRobot(controller)}, gateway, joined, programs
    )


def test_a_program_for_the_authors_simulator_moves_an_arm() -> None:
    robot = IdealRobot(motion(arms=ARMS))
    gateway = MemoryGateway(
        "ros", GatewayParams.model_validate({"profile": "vrep", "arms": ARMS, "publish_period": "4545 us"})
    )
    goal = np.array([0.2, -0.1, 0.1, 0.3, 0.2, -0.4])

    def programs(transport: MemoryTransport) -> None:
        until(lambda: transport.heard("/dvrk/PSM2/robot_state"), lambda told: told.data == "uninitialized")
        transport.send("/dvrk/PSM2/set_robot_state", StringMessage(data="Home"))
        until(lambda: transport.heard("/dvrk/PSM2/robot_state"), lambda told: told.data == "Home")
        transport.send("/dvrk/PSM1/state_joint_desired", JointState(position=goal))
        transport.send("/dvrk/PSM1/state_jaw_desired", JointState(position=np.array([1.0])))
        until(
            lambda: transport.heard("/dvrk/PSM1/state_joint_current")[-1:],
            lambda told: np.allclose(told.position, goal),
        )
        until(
            lambda: transport.heard("/dvrk/PSM1/state_jaw_current")[-1:],
            lambda told: np.allclose(told.position, 0.4106),
        )
        newest = transport.heard("/dvrk/PSM1/state_joint_current")[-1]
        assert (newest.name, newest.velocity.size, newest.effort.size) == ([], 6, 0)
        assert transport.heard("/dvrk/setup_joint/state_joint_current")[-1].position.size == 14

    joined = ["ros.* -> paper.*", "paper.* -> ros.*", "paper.* -> robot.*", "robot.* -> paper.*"]
    play(
        {"paper": VrepScene("paper", VrepSceneParams.model_validate({"arms": ARMS})), "robot": robot},
        gateway,
        joined,
        programs,
    )
