from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

class OptimizeResult:
    x: NDArray[np.float64]
    cost: float
    jac: NDArray[np.float64]

def minimize(
    fun: Callable[[NDArray[np.float64]], float],
    x0: NDArray[np.float64],
    *,
    method: Literal["L-BFGS-B"],
    options: Mapping[str, int],
) -> OptimizeResult: ...
def least_squares(
    fun: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    x0: NDArray[np.float64],
    *,
    bounds: tuple[ArrayLike, ArrayLike],
    x_scale: Literal["jac"],
    max_nfev: int,
) -> OptimizeResult: ...
