"""Conformance checks for participants, a driver, and sessions in one process: for tests of plug-ins.

Authors of participants call `check_engine` or `check_device` in their own tests. A failure is an
AssertionError that quotes the broken rule of `hub.participant`.
"""

from hub.testing.devices import check_device
from hub.testing.driver import Driver
from hub.testing.engines import check_engine
from hub.testing.sessions import run_in_process

__all__ = ["Driver", "check_device", "check_engine", "run_in_process"]
