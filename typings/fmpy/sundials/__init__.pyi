from collections.abc import Callable
from typing import Any

class CVodeSolver:
    def __init__(
        self,
        nx: int,
        nz: int,
        get_x: Callable[[Any, int], object],
        set_x: Callable[[Any, int], object],
        get_dx: Callable[[Any, int], object],
        get_z: Callable[[Any, int], object],
        get_nominals: Callable[[Any, int], object],
        set_time: Callable[[float], object],
        input: Any,
        startTime: float,
        maxStep: float = ...,
        relativeTolerance: float = ...,
        maxNumSteps: int = ...,
    ) -> None: ...
    def f(self, t: float, y: Any, ydot: Any, user_data: Any) -> int: ...
    def g(self, t: float, y: Any, gout: Any, user_data: Any) -> int: ...
    def step(self, t: float, tNext: float) -> tuple[bool, Any, float]: ...
    def reset(self, time: float) -> None: ...
