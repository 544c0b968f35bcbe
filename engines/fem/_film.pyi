import numpy as np
from numpy.typing import NDArray

_Arrays = tuple[NDArray[np.generic], ...]

def run(
    arrays: _Arrays,
    mobility: float,
    hanging: float,
    down: float,
    thinner: float,
    seconds: float,
    sub_steps: int,
    /,
) -> int: ...
def emit(arrays: _Arrays, seconds: float, /) -> int: ...
def measure(arrays: _Arrays, step: float, /) -> None: ...
