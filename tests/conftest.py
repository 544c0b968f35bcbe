"""Settings of all tests: Hypothesis draws the same examples every time, and no test depends on its duration;
numpy computes as in the hosts; markers follow from fixtures.
"""

from __future__ import annotations

import os
import sys

import pytest
from hypothesis import HealthCheck, settings

from hub.hosting.numerics import pin_numerics

# Where no bytecode is written, as in many containers, each of hundreds of processes compiles the project.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
pin_numerics(os.environ)  # before any test imports numpy: a process with other kernels has other hashes
for _name, _examples in (("local", 20), ("ci", 100)):
    settings.register_profile(
        _name,
        max_examples=_examples,
        derandomize=True,
        deadline=None,
        suppress_health_check=[HealthCheck.too_slow],
    )
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE") or ("ci" if os.environ.get("CI") else "local"))

MARKERS = {"browser": "browser", "rclpy_python": "ros"}
"""Markers of the tests that use a fixture, by the fixture's name."""


@pytest.hookimpl(tryfirst=True)  # before pytest deselects by markers
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        for fixture in MARKERS.keys() & set(getattr(item, "fixturenames", ())):
            item.add_marker(MARKERS[fixture])


@pytest.fixture(scope="session")
def opengl() -> None:
    """Skip a test of pictures where nothing draws; asked by tests, as the answer takes a process or two."""
    opengl = pytest.importorskip("engines.mujoco.pictures.opengl", reason="needs trocar[mujoco]")
    if not (found := opengl.find()).name:
        pytest.skip(f"no OpenGL: {found.detail}")


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown() -> None:
    """Fail a test that leaves its process with a real-time priority, which its children inherit."""
    if hasattr(os, "sched_getscheduler") and os.sched_getscheduler(0) != os.SCHED_OTHER:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        pytest.fail("the test has left its process with a real-time priority")
