import numpy as np
from numpy.typing import NDArray

def lay_out(
    queued: list[tuple[int, int, bytes]],
    layouts: list[tuple[bytes, int, bytes, bytes, bytes, bytes]],
    first_block: int,
    /,
) -> tuple[bytes, bytes]: ...
def index(
    channels: NDArray[np.int64], times_ns: NDArray[np.int64], offsets: NDArray[np.int64], /
) -> tuple[bytes, bytes]: ...
