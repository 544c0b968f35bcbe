"""A gateway in a session: programs enable, home and move an arm as on the real system, and nothing moves that
should not.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from time import monotonic, sleep, time_ns

import numpy as np
import pytest

from devices.ros.params import GatewayParams
from hub.testing import run_in_process
from schemas.crtk import OperatingState, StringStamped
from schemas.ros import EmptyMessage, Header, JointState, StringMessage, Time
from tests.devices.ros.ideal_robot import IdealRobot, motion
from tests.devices.ros.memory import MemoryGateway, MemoryTransport

pytest.importorskip("ruckig")

ARMS = {"PSM1": {"instrument": "400006"}}
HOME = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.0])


class Console:
    """Waits as crtk_python_client does: for busy told after the order, then for not busy."""

    def __init__(
        self, transport: MemoryTransport, name: str = "/console", gateway: MemoryGateway | None = None
    ) -> None:
        self.transport, self.name, self.gateway = transport, name, gateway

    def order(self, topic: str, message: object) -> None:
        self.transport.send(f"/PSM1/{topic}", message, self.name)  # pyright: ignore[reportArgumentType]

    def command(self, text: str) -> None:
        self.order("state_command", StringStamped(header=Header(stamp=Time.from_ns(time_ns())), string=text))

    def move(self, *positions: float) -> None:
        since = time_ns()
        self.order("move_jp", JointState(position=np.array(positions)))
        self.until(
            lambda: (
                [s.is_busy for s in self.states(since)][-1:] == [False]
                and any(s.is_busy for s in self.states(since))
            )
        )

    def states(self, since: int = 0) -> list[OperatingState]:
        told = self.transport.heard("/PSM1/operating_state")
        return [
            state for state in told if isinstance(state, OperatingState) and state.header.stamp.ns > since
        ]

    def until(self, holds: Callable[[], bool], seconds: float = 30.0) -> None:
        end = monotonic() + seconds
        while not holds():
            assert monotonic() < end, f"still waiting; states: {self.states()[-3:]}"
            sleep(0.003)

    @property
    def positions(self) -> np.ndarray:
        newest = self.transport.heard("/PSM1/measured_js")[-1]
        assert isinstance(newest, JointState)
        return newest.position

    def words(self, topic: str) -> list[str]:
        return [
            message.data
            for message in self.transport.heard(f"/PSM1/{topic}")
            if isinstance(message, StringMessage)
        ]


@contextmanager
def session(duration: str) -> Generator[Console]:
    """Run a session in another thread."""
    controller = motion(arms=ARMS, mounting="cart")
    gateway = MemoryGateway(
        "ros", GatewayParams.model_validate({"arms": ARMS, "mounting": "cart", "publish_period": "5 ms"})
    )
    scenario = {
        "name": "with_ros",
        "step": "2 ms",
        "duration": duration,
        "pace": "realtime",
        "order": ["motion", "robot"],
        "connections": [
            "motion.drive/* -> robot.*",
            "robot.* -> motion.sense/*",
            "motion.* -> ros.*",
            "ros.* -> motion.*",
        ],
    }
    participants = {"motion": controller, "robot": IdealRobot(controller), "ros": gateway}
    with ThreadPoolExecutor(1) as pool:
        run = pool.submit(run_in_process, scenario, participants)
        while not hasattr(gateway, "transport"):
            assert not run.done(), run.result()
            sleep(0.01)
        yield Console(gateway.transport, gateway=gateway)
        run.result()


def test_a_console_drives_an_arm_as_on_the_real_system() -> None:
    with session("4 s") as console:
        console.until(lambda: bool(console.states()))
        assert console.states()[-1].state == "DISABLED"
        console.order("servo_jp", JointState(position=HOME + 0.1))  # to an arm that is disabled
        console.until(lambda: any("servo_jp refused" in told for told in console.words("warning")))
        since = time_ns()
        console.command("home")
        console.until(lambda: any(s.is_homed and not s.is_busy for s in console.states(since)))
        edges = [(s.state, s.is_homed, s.is_busy) for s in console.states(since)]
        assert edges[0] == ("DISABLED", False, True)
        assert ("ENABLED", False, True) in edges
        console.move(*(HOME + 0.02))
        # states come after their own time
        console.until(lambda: np.allclose(console.positions, HOME + 0.02, atol=1e-6))
        console.move(*(HOME + 0.02))  # nothing to move, and yet busy and then idle
        Console(console.transport, "/other").order("move_jp", JointState(position=HOME))
        console.order("move_jp", JointState(position=np.array([0.0, 0.0, 0.9, 0.0, 0.0, 0.0])))
        console.until(lambda: any("insertion" in told for told in console.words("error")))
        assert any("/other may not move the arm" in told for told in console.words("warning"))
        Console(console.transport, "/other").order("hold", EmptyMessage())
        sleep(0.05)
        np.testing.assert_allclose(console.positions, HOME + 0.02, atol=1e-6)
        stamps = [state.header.stamp.ns for state in console.states()]
        assert stamps == sorted(set(stamps))


def test_states_are_sent_to_the_gateway_while_a_program_subscribes() -> None:
    topic = "/PSM1/measured_cp"
    with session("4 s") as console:
        gateway = console.gateway
        assert gateway is not None
        console.until(lambda: topic[1:] in gateway._states)
        pose, joints = (gateway._states[name] for name in (topic[1:], "PSM1/measured_js"))
        console.until(lambda: pose.writes > 0)
        console.transport.let_go(topic)
        console.until(lambda: not pose.used)
        sleep(0.1)
        before, since = pose.writes, joints.writes
        console.until(lambda: joints.writes > since + 10)
        assert pose.writes == before
        console.transport.let_go()
        console.until(lambda: pose.writes > before + 10)
