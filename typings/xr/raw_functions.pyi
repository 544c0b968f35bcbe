from ctypes import Structure
from typing import Any

from xr import Result

def xrLocateSpace(space: Structure, base: Structure, time: int, location: Any) -> Result: ...  # noqa: N802
