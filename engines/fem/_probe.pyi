from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

class Probe:
    def __init__(
        self, arrays: Sequence[NDArray[np.generic]], first: int, prediction: int, is_mean: bool, /
    ) -> None: ...
    def begin(
        self, position: NDArray[np.float64], velocity: NDArray[np.float64], seconds: float, /
    ) -> None: ...
    def end(self) -> bool: ...

def near_faces(
    centres: NDArray[np.float64],
    reach: NDArray[np.float64],
    nodes: NDArray[np.float64],
    faces: NDArray[np.int64],
    spheres: NDArray[np.int64],
    near: NDArray[np.int64],
    weights: NDArray[np.float64],
    distances: NDArray[np.float64],
    /,
) -> int: ...
def closest_on_faces(
    point: NDArray[np.float64],
    corners: NDArray[np.float64],
    weights: NDArray[np.float64],
    distances: NDArray[np.float64],
    normals: NDArray[np.float64],
    /,
) -> None: ...
def sum_at_nodes(
    faces: NDArray[np.int64],
    weights: NDArray[np.float64],
    first: int,
    first_weights: NDArray[np.float64],
    nodes: NDArray[np.int64],
    parts: NDArray[np.float64],
    /,
) -> int: ...
