import numpy as np
from numpy.typing import NDArray

def expose(
    picture: NDArray[np.uint8],
    light: NDArray[np.float32],
    gains: NDArray[np.float32],
    noise: NDArray[np.float32] | None,
    dark: float,
    found: NDArray[np.uint8],
) -> None: ...
