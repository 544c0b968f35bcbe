"""Many calls of a function at a time: in threads or processes of this machine, or on a Ray cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, Literal, TypeVar

from schemas.errors import ConnectError, SessionError

__all__ = ["run_calls"]

T = TypeVar("T")

_DRAWING_THREADS = "LP_NUM_THREADS"
"""Threads of Mesa's software renderers, by default one for each core (https://docs.mesa3d.org/envvars.html)."""


def run_calls(
    function: Callable[..., T],
    calls: Sequence[tuple[Any, ...]],
    jobs: int,
    *,
    ray: str | None = None,
    workers: Literal["threading", "loky"] = "loky",
) -> Iterator[tuple[int, T]]:
    """Yield the number of each call, from 0, and its result, in the order in which they end.

    Worker processes share the cores: pictures drawn without a GPU take no more threads than a worker's part.

    Args:
        function: a function of a module.
        calls: arguments of each call.
        jobs: number of calls at a time; left to Ray on a cluster.
        ray: address of a Ray cluster with nodes for the calls.
        workers: threads, for calls that start processes of their own, or processes.

    Raises ConnectError if there is no cluster, and SessionError if the cluster fails.
    """
    if ray:
        yield from _on_ray(function, calls, ray)
        return
    from joblib import Parallel, delayed

    parallel = Parallel(n_jobs=jobs, backend=workers, return_as="generator_unordered", batch_size=1)
    is_alone = workers == "threading" or _DRAWING_THREADS in os.environ  # what the user says stands
    run = _numbered if is_alone else partial(_numbered_on, max(1, (os.cpu_count() or 1) // jobs))
    yield from parallel(delayed(run)(number, function, call) for number, call in enumerate(calls))


def _on_ray(
    function: Callable[..., T], calls: Sequence[tuple[Any, ...]], address: str
) -> Iterator[tuple[int, T]]:
    import ray
    from ray.exceptions import RayError

    # joblib's own backend for Ray gives results only when all are there, which an interruption would lose
    try:
        ray.init(address=address, log_to_driver=False)
    except (OSError, RuntimeError, ValueError) as error:
        raise ConnectError(
            f"no Ray cluster at '{address}': {error}. Run the command on a node of the cluster, with auto or"
            " the HOST:PORT of `ray status`"
        ) from error
    try:
        run = ray.remote(num_cpus=1)(_numbered_on)
        pending = [run.remote(1, number, function, call) for number, call in enumerate(calls)]
        while pending:
            done, pending = ray.wait(pending)
            yield ray.get(done[0])
    except RayError as error:
        raise SessionError(
            f"the Ray cluster at '{address}' has failed: {error}. The same command goes on"
        ) from error
    finally:
        ray.shutdown()


def _numbered_on(cores: int, number: int, function: Callable[..., T], call: tuple[Any, ...]) -> tuple[int, T]:
    """Call in a worker process; its software renderer takes as many threads as `cores`."""
    os.environ[_DRAWING_THREADS] = str(cores)  # a worker may have served other calls before
    return _numbered(number, function, call)


def _numbered(number: int, function: Callable[..., T], call: tuple[Any, ...]) -> tuple[int, T]:
    return number, function(*call)
