"""The same linear algebra on every machine.

numpy's OpenBLAS chooses its kernels by processor, and they round differently.
"""

from __future__ import annotations

import platform
from collections.abc import MutableMapping

__all__ = ["pin_blas"]


def pin_blas(environment: MutableMapping[str, str]) -> None:
    """Set kernel and threads in `environment`, for processes that have not imported numpy yet.

    Haswell is the oldest x86-64 with AVX2, and its kernels run on all later ones. One thread: idle ones spin
    and take the cores of other hosts, and results must not depend on how many there are.
    """
    environment["OPENBLAS_NUM_THREADS"] = environment["OMP_NUM_THREADS"] = "1"
    if platform.machine() in ("x86_64", "AMD64"):
        environment["OPENBLAS_CORETYPE"] = "Haswell"
