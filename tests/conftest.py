"""Settings of all tests: Hypothesis draws the same examples every time, and no test depends on how long it
takes; numpy computes as in the hosts.
"""

from __future__ import annotations

import os

from hypothesis import HealthCheck, settings

from hub.hosting.blas import pin_blas

pin_blas(os.environ)  # before any test imports numpy: a process with other kernels has other hashes
settings.register_profile(
    "trocar", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("trocar")
