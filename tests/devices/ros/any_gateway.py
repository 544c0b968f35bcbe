"""A session whose gateway is of any kind, and a program of that middleware on its other side.

`dds` is real rclpy, `ros1` real rospy with a real master, `zenoh` the peer written from rmw_zenoh's design.
A test takes the fixture `middleware` and is run once for each.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml

from hub.planning import registry
from hub.planning.scenario_file import load
from hub.session.launch import launch
from tests.devices.ros.crtk_table import Peer
from tests.devices.ros.rclpy_environment import rclpy_python
from tests.devices.ros.rclpy_peer import RclpyPeer, free_domain
from tests.devices.ros.rospy_peer import Program, master, needs_rospy
from tests.devices.ros.rospy_peer import TablePeer as RospyPeer
from tests.devices.ros.zenoh.test_gateway import TablePeer as ZenohTable
from tests.devices.ros.zenoh.zenoh_peer import Peer as ZenohPeer
from tests.waiting import until

__all__ = ["Middleware", "middleware", "rclpy_python"]


@dataclass
class Middleware:
    """One kind of gateway, and its programs."""

    kind: str
    settings: dict[str, Any]
    """Of the gateway: where its programs are."""
    opened: Callable[[Any], Any]
    """From a session to a context with a program."""
    directory: Path

    def run(self, tree, owners, program):
        """Run a scenario while `program(peer, rows by topic)` runs in another thread; return what it returns.

        The peer has the topics of `owners`.
        """
        ros = {name: value for name, value in tree["participants"]["ros"].items() if name != "host"}
        ros |= {"kind": self.kind, "publish_period": "20 ms", **self.settings}
        tree["participants"]["ros"] = {**ros, "host": "ros"}
        file = self.directory / "scenario.yaml"
        file.write_text(yaml.safe_dump(tree))
        loaded = load(str(file))
        gateway = registry.load(self.kind)("ros", loaded.params["ros"])
        rows = {row.topic: row for row in gateway.rows if row.owner in owners}
        session = launch(loaded, endpoint="tcp/127.0.0.1:0", record=self.directory / "seen")

        def ran():
            try:
                with self.opened(session) as peer:
                    return program(peer, rows)
            finally:
                session.state.shutdown()

        with ThreadPoolExecutor(1) as pool:
            result = pool.submit(ran)
            session.run()
        return result.result()


class ZenohProgram(ZenohTable):
    """A program that waits for the topics it wants."""

    def join(self, rows):
        wanted = {row.topic for row in rows}
        until(lambda: wanted <= {entry[2] for entry in self.peer.graph() if len(entry) > 2})
        super().join(rows)


@contextmanager
def zenoh_program(session) -> Iterator[Peer]:
    with ZenohPeer(session.programs_endpoint) as peer:
        yield ZenohProgram(peer)


@contextmanager
def rospy_program(ros) -> Iterator[Peer]:
    with Program(ros) as console:
        yield RospyPeer(console)


@pytest.fixture(
    params=[
        pytest.param("dds", marks=pytest.mark.ros),
        pytest.param("ros1", marks=[pytest.mark.ros, needs_rospy]),
        "zenoh",
    ]
)
def middleware(request, tmp_path):
    """Each of the gateways' kinds."""
    if request.param == "dds":
        pytest.importorskip("cyclonedds")
        python, domain = request.getfixturevalue("rclpy_python"), free_domain()
        yield Middleware("ros2-dds", {"domain": domain}, lambda _: RclpyPeer(python, domain), tmp_path)
    elif request.param == "zenoh":
        yield Middleware("ros2-zenoh", {}, zenoh_program, tmp_path)
    else:
        with master(tmp_path) as ros:
            yield Middleware("ros1", {"master": ros.uri}, lambda _: rospy_program(ros), tmp_path)
