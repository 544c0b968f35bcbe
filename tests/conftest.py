"""Settings of all tests: Hypothesis draws the same examples every time, and no test depends on how long it
takes; numpy computes as in the hosts; a run that ends with one of its workers has an exit code of its own.
"""

from __future__ import annotations

import os
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from hub.hosting.numerics import pin_numerics

pin_numerics(os.environ)  # before any test imports numpy: a process with other kernels has other hashes
settings.register_profile(
    "trocar", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("trocar")

WORKER_DIED = 6
"""Exit code, behind those of pytest: tests were left out, so it is no use to repeat those that failed."""

_died = pytest.StashKey[bool]()


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any, error: object | None) -> None:
    node.config.stash[_died] = node.config.stash.get(_died, False) or error is not None


def pytest_sessionfinish(session: pytest.Session) -> None:
    if session.config.stash.get(_died, False):
        session.exitstatus = WORKER_DIED
