"""What Trocar uses of zenoh.handlers."""

from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

T = TypeVar("T")

class Handler(Generic[T]):
    def recv(self) -> T: ...
    def try_recv(self) -> T | None: ...
    def __iter__(self) -> Iterator[T]: ...

class FifoChannel(Generic[T]):
    def __init__(self, capacity: int) -> None: ...

class RingChannel(Generic[T]):
    def __init__(self, capacity: int) -> None: ...

class Callback(Generic[T]):
    def __init__(
        self,
        callback: Callable[[T], object],
        drop: Callable[[], object] | None = None,
        *,
        indirect: bool = True,
    ) -> None: ...
