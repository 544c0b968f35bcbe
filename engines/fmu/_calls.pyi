from typing import Any

from numpy.typing import NDArray

from schemas.vectors import Vector

class Blocks:
    def __new__(
        cls,
        component: int,
        blocks: tuple[tuple[int, bool, bytes, NDArray[Any], Vector, bool, tuple[tuple[str, int], ...]], ...],
        /,
    ) -> Blocks: ...
    def set(
        self, values: dict[str, Any], rates: dict[str, Vector], tau: float, first: int, /
    ) -> tuple[int, int] | None: ...
    def step2(
        self,
        outputs: Blocks,
        function: int,
        values: dict[str, Any],
        rates: dict[str, Vector],
        tau: float,
        now: float,
        size: float,
        /,
    ) -> tuple[int, int, int] | None: ...
    def get(self) -> tuple[int, int] | None: ...
    def forget(self) -> None: ...

def step3(function: int, component: int, now: float, size: float, /) -> tuple[int, int, int, int, float]: ...
def serialise(
    get: int, size: int, serialise: int, component: int, state: int, /
) -> bytes | tuple[int, int]: ...
