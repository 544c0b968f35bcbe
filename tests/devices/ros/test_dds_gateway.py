"""The gateway to ROS 2 over DDS, as real rclpy sees it."""

import time
from contextlib import contextmanager

import pytest

from devices.ros.dds_gateway import DdsGateway
from tests.devices.ros.crtk_table import WHOLE, check_late_joiner, check_published, check_served, check_subscribed, exercise
from tests.devices.ros.rclpy_environment import rclpy_python
from tests.devices.ros.rclpy_peer import RclpyPeer, free_domain

__all__ = ["rclpy_python"]

ARM = {"arms": {"PSM1": {}}, "cameras": []}


@pytest.fixture
def domain():
    return free_domain()


@contextmanager
def showing(directory, **params):
    with DdsGateway("ros", DdsGateway.params_model.model_validate(params)) as gateway:
        gateway.open(directory)
        yield gateway


def until(condition, seconds=5.0):
    """Wait until `condition` holds; say whether it did."""
    end = time.monotonic() + seconds
    while not (held := condition()) and time.monotonic() < end:
        time.sleep(0.005)
    return held


class Console(RclpyPeer):
    """A program that waits until the gateway has found it, too: nobody gets what was published before that."""

    def __init__(self, python, gateway, name="console", **settings):
        super().__init__(python, gateway.params.domain, name, **settings)
        self.gateway = gateway

    def join(self, rows):
        super().join(rows)
        topics = {f"rt{row.topic}" for row in rows if row.way == "publish"}
        writers = [writer for writer in self.gateway._transport._writers if writer.topic.name in topics]
        assert until(lambda: all(writer.get_publication_matched_status().current_count for writer in writers))


def test_every_row_of_the_table(rclpy_python, domain, tmp_path):
    with showing(tmp_path, **WHOLE, domain=domain) as gateway:
        with Console(rclpy_python, gateway) as console:
            console.join(gateway.rows)
            exercise(gateway, console)
        with Console(rclpy_python, gateway, "late") as late:
            check_late_joiner(gateway, late)
