from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

def advance(
    arrays: Sequence[NDArray[np.generic]],
    tissues: NDArray[np.float64],
    book: NDArray[np.float64],
    seconds: float,
    sub_steps: int,
    /,
) -> None: ...
def bind(arrays: Sequence[NDArray[np.generic]], tissues: NDArray[np.float64], most: float, /) -> float: ...
def spread(arrays: Sequence[NDArray[np.generic]], reach: float, /) -> float: ...
