from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

class Solid:
    def __init__(self, arrays: Sequence[NDArray[np.generic]], /) -> None: ...
    def advance(
        self,
        path: NDArray[np.float64],
        radius: NDArray[np.float64],
        free: NDArray[np.uint8],
        force: NDArray[np.float64],
        friction: float,
        mass: NDArray[np.float32],
        seconds: float,
        sub_steps: int,
        gravity: float,
        drag: float,
        /,
    ) -> None: ...
    def forces(self, seconds: float, /) -> None: ...
