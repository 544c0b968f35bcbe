from collections.abc import Sequence
from typing import Any

from numpy.typing import NDArray

class Index:
    def __init__(self, data: NDArray[Any], *, name: str) -> None: ...

class DataFrame:
    def __init__(self, data: NDArray[Any], index: Index, columns: Sequence[str]) -> None: ...
