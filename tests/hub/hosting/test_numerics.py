"""Every process of a session computes with the same loops, whatever the processor has."""

from __future__ import annotations

import os
import platform
import subprocess
import sys

import pytest

from hub.hosting.numerics import pin_numerics

_LOOPS = """
from numpy._core import _multiarray_umath as umath
print(*(name for name in umath.__cpu_dispatch__ if umath.__cpu_features__[name]))
print(*umath.__cpu_dispatch__)
"""


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="numpy's loops for x86-64")
def test_numpy_uses_nothing_newer_than_avx2() -> None:
    environment = os.environ | {"NPY_ENABLE_CPU_FEATURES": "X86_V3"}
    pin_numerics(environment)
    command = [sys.executable, "-W", "error", "-c", _LOOPS]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    used, known = (line.split() for line in done.stdout.splitlines())
    assert used == ["X86_V3"]
    assert {*known} - {*environment["NPY_DISABLE_CPU_FEATURES"].split()} == {"X86_V3"}
