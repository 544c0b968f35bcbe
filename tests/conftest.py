"""Settings of all tests: Hypothesis draws the same examples every time, and no test depends on how long it takes."""

from __future__ import annotations

from hypothesis import HealthCheck, settings

settings.register_profile("trocar", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("trocar")
