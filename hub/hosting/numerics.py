"""The same arithmetic on every machine.

numpy and its OpenBLAS choose their loops by processor, and these round differently.
"""

from __future__ import annotations

import platform
from collections.abc import MutableMapping

__all__ = ["pin_numerics"]

_NEWER_THAN_AVX2 = "X86_V4 AVX512_ICL AVX512_SPR"
"""Groups of instructions beyond AVX2 with loops in numpy (numpy's documentation, CPU dispatch).

With these groups `arctan2` and others are Intel's, which differ in the last bit from the C library's.
"""


def pin_numerics(environment: MutableMapping[str, str]) -> None:
    """Set loops, kernel and threads in `environment`, for processes that have not imported numpy yet.

    Haswell is the oldest x86-64 with AVX2, and Haswell kernels run on all later processors. A single thread:
    idle threads spin and take the cores of other hosts, and results must not depend on the number of threads.
    """
    environment["OPENBLAS_NUM_THREADS"] = environment["OMP_NUM_THREADS"] = "1"
    if platform.machine() in ("x86_64", "AMD64"):
        environment["OPENBLAS_CORETYPE"] = "Haswell"
        environment["NPY_DISABLE_CPU_FEATURES"] = _NEWER_THAN_AVX2
        environment.pop("NPY_ENABLE_CPU_FEATURES", None)  # numpy refuses both at once
