"""What Trocar uses of ruckig 0.19 (nanobind module without annotations)."""

from collections.abc import Sequence
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

class RuckigError(Exception): ...

class Result(IntEnum):
    Working = 0
    Finished = 1
    Error = -1

class InputParameter:
    def __init__(self, dofs: int) -> None: ...
    current_position: Sequence[float] | NDArray[np.float64]
    current_velocity: Sequence[float] | NDArray[np.float64]
    current_acceleration: Sequence[float] | NDArray[np.float64]
    target_position: Sequence[float] | NDArray[np.float64]
    max_velocity: Sequence[float] | NDArray[np.float64]
    max_acceleration: Sequence[float] | NDArray[np.float64]
    max_jerk: Sequence[float] | NDArray[np.float64]

class Trajectory:
    def __init__(self, dofs: int) -> None: ...
    @property
    def duration(self) -> float: ...
    def at_time(self, time: float) -> tuple[list[float], list[float], list[float]]: ...

class Ruckig:
    def __init__(self, dofs: int) -> None: ...
    def calculate(self, input: InputParameter, trajectory: Trajectory) -> Result: ...
