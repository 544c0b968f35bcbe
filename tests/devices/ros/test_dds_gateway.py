"""The gateway to ROS 2 over DDS, as real rclpy sees it."""

import os
import time
from contextlib import contextmanager

import pytest

from devices.ros.dds_gateway import DdsGateway
from tests.devices.ros.crtk_table import WHOLE, check_late_joiner, check_published, check_served, check_subscribed, exercise
from tests.devices.ros.rclpy_environment import rclpy_python
from tests.devices.ros.rclpy_peer import RclpyPeer

__all__ = ["rclpy_python"]

ARM = {"arms": {"PSM1": {}}, "cameras": []}


@pytest.fixture
def domain(request):
    """A domain of this process."""
    return 1 + os.getpid() % 100


@contextmanager
def showing(directory, **params):
    with DdsGateway("ros", DdsGateway.params_model.model_validate(params)) as gateway:
        gateway.open(directory)
        yield gateway


def test_every_row_of_the_table(rclpy_python, domain, tmp_path):
    with showing(tmp_path, **WHOLE, domain=domain) as gateway:
        with RclpyPeer(rclpy_python, domain) as console:
            t0 = time.time()
            console.join([r for r in gateway.rows if r.way != "serve"])
            print("join", time.time() - t0); t0 = time.time()
            check_published(gateway, console, gateway.rows)
            print("pub", time.time() - t0); t0 = time.time()
            check_subscribed(gateway, console, gateway.rows)
            print("sub", time.time() - t0); t0 = time.time()
        with RclpyPeer(rclpy_python, domain, "late") as late:
            check_late_joiner(gateway, late)
            print("late", time.time() - t0)
