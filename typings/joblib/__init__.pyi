from collections.abc import Callable, Iterable, Iterator
from typing import Any, Literal, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

def delayed(function: Callable[P, R]) -> Callable[P, R]: ...

class Parallel:
    def __init__(
        self,
        n_jobs: int | None = ...,
        backend: str | None = ...,
        return_as: Literal["list", "generator", "generator_unordered"] = ...,
        batch_size: int | Literal["auto"] = ...,
    ) -> None: ...
    def __call__(self, iterable: Iterable[R]) -> Iterator[R]: ...
    def __getattr__(self, name: str) -> Any: ...
