from collections.abc import Callable
from typing import Any

def packb(o: Any, *, default: Callable[[Any], Any] | None = None) -> bytes: ...
def unpackb(
    packed: bytes,
    *,
    object_hook: Callable[[dict[Any, Any]], Any] | None = None,
    strict_map_key: bool = True,
) -> Any: ...
