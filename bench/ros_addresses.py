"""Addresses of each kind of gateway for `bench/ros.py`, and the Python with its client library."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

__all__ = ["PLACES", "Place"]

DOMAIN = 77


@dataclass(frozen=True)
class Place:
    """What the gateway and the console are told."""

    python: Path
    params: dict[str, Any] = field(default_factory=dict[str, Any])
    """Of the gateway, beside those of every kind."""
    environment: dict[str, str] = field(default_factory=lambda: dict(os.environ))


@contextmanager
def zenoh() -> Iterator[Place]:
    yield Place(Path(sys.executable))


@contextmanager
def dds() -> Iterator[Place]:
    from tests.devices.ros.rclpy_environment import python
    from tests.devices.ros.rclpy_peer import environment

    yield Place(python(), {"domain": DOMAIN}, environment(DOMAIN))


@contextmanager
def ros1() -> Iterator[Place]:
    from tests.devices.ros.rospy_peer import master

    with tempfile.TemporaryDirectory() as directory, master(Path(directory)) as ros:
        yield Place(Path(ros.python), {"master": ros.uri}, ros.environment)


PLACES: dict[str, Callable[[], AbstractContextManager[Place]]] = {
    "ros2-zenoh": zenoh,
    "ros2-dds": dds,
    "ros1": ros1,
}
"""By the gateway's kind."""
