from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mujoco import MjModel

class Batch:
    state: NDArray[np.float64]
    warning: NDArray[np.int32]
    def __init__(self, model: MjModel, nsim: int, nthread: int = 0, persistent: bool = False) -> None: ...
    def rollout(
        self, nstep: int, control: NDArray[np.float64] | None = None, *, record: Sequence[str] = ...
    ) -> dict[str, NDArray[np.float64]]: ...
