from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

class Solid:
    counts: tuple[int, int]
    def __init__(self, arrays: Sequence[NDArray[np.generic]], nodes: int, faces: int, /) -> None: ...
    def advance(
        self,
        path: NDArray[np.float64],
        middle: NDArray[np.float64],
        radius: NDArray[np.float64],
        free: NDArray[np.uint8],
        force: NDArray[np.float64],
        friction: float,
        seconds: float,
        sub_steps: int,
        gravity: float,
        drag: float,
        ends: NDArray[np.int32],
        toughness: NDArray[np.float64],
        element: NDArray[np.int32],
        front: NDArray[np.float64],
        ahead: NDArray[np.float64],
        area: NDArray[np.float64],
        /,
    ) -> int: ...
    def forces(self, seconds: float, /) -> None: ...
    def open(self, faces: NDArray[np.int32], /) -> int: ...
    def remove(self, elements: NDArray[np.int32], /) -> int: ...
    def tear(self, stretch: float, toughness: float, /) -> int: ...
    def measure(self) -> tuple[float, float]: ...
    def pieces(self, labels: NDArray[np.int32], /) -> None: ...

class Together:
    def __init__(
        self,
        solids: tuple[Solid, ...],
        middles: NDArray[np.float64],
        frictions: NDArray[np.float64],
        forces: NDArray[np.float64],
        ahead: float,
        skin: float,
        /,
    ) -> None: ...
    def advance(self, arguments: tuple[tuple[Any, ...], ...], /) -> int: ...
    def attach(
        self,
        place: NDArray[np.int32],
        rest: NDArray[np.float64],
        law: NDArray[np.float64],
        widest: NDArray[np.float64],
        force: NDArray[np.float64],
        /,
    ) -> None: ...
    def forget(self) -> None: ...
