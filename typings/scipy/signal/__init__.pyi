from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

def butter(N: int, Wn: float, *, fs: float, output: Literal["sos"]) -> NDArray[np.float64]: ...
def sosfiltfilt(sos: NDArray[np.float64], x: ArrayLike, axis: int = -1) -> NDArray[np.float64]: ...
