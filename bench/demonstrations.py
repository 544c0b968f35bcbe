"""What a demonstration costs with one worker, and with a worker for each core.

    python -m bench.demonstrations                       # 3 minutes
    python -m bench.demonstrations --episodes 40 --looks endoscope

An oracle picks up a needle; each episode is drawn for both eyes and encoded, as by `trocar demonstrate`.
*core-seconds*: processor time of an episode, all threads of the worker. *cores*: processor time over time,
of all workers. Drawing and encoding have threads, so one worker can use more than a core: it is measured
with all cores, and held to one. *of one core*: episodes an hour over those of the worker on one core. The
first episode of a worker, which loads libraries and looks for OpenGL, is left out.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from dataclasses import dataclass
from time import perf_counter, process_time
from typing import Literal

from joblib.externals.loky import get_reusable_executor

from learning.datasets.conversion import OPEN_H_SIZE
from learning.datasets.episode import Wanted
from learning.demonstrations.episode import Order, demonstrate
from learning.workers import run_calls


@dataclass(frozen=True)
class Timed:
    """An episode as its worker saw it, in seconds."""

    worker: int
    begin_s: float
    end_s: float
    core_s: float


def time_episode(order: Order, seed: int, place: str, cores: tuple[int, ...]) -> Timed:
    """Demonstrate in a worker that is held to these cores. Raises ValueError if the oracle failed."""
    os.sched_setaffinity(0, cores)
    begin, cpu = perf_counter(), process_time()
    row = demonstrate(order, seed, place)
    if row["failure"]:
        raise ValueError(f"seed {seed}: {row['failure']}")
    return Timed(os.getpid(), begin, perf_counter(), process_time() - cpu)


def measure(order: Order, episodes: int, jobs: int, cores: tuple[int, ...]) -> tuple[float, float, float]:
    """Return core-seconds of an episode, cores in use, and episodes an hour."""
    with tempfile.TemporaryDirectory() as directory:
        calls = [(order, seed, f"{directory}/{seed:05d}", cores) for seed in range(jobs + episodes)]
        timed = [result for _, result in run_calls(time_episode, calls, jobs)]
    get_reusable_executor().shutdown()  # else the next workers are these
    workers = [[one for one in timed if one.worker == worker] for worker in {one.worker for one in timed}]
    kept = [one for own in workers for one in sorted(own, key=lambda one: one.begin_s)[1:]]
    core_s = sum(one.core_s for one in kept) / len(kept)
    rate = jobs * len(kept) / sum(one.end_s - one.begin_s for one in kept)
    return core_s, core_s * rate, 3600.0 * rate


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--episodes", type=int, default=12, help="for each row")
    parser.add_argument("--looks", choices=("plain", "endoscope"), default="plain")
    words = parser.parse_args()
    looks: Literal["plain", "endoscope"] = words.looks
    order = Order("trocar/NeedlePick-v0", (), Wanted(30, OPEN_H_SIZE, format="open-h", looks=looks))
    cores = tuple(sorted(os.sched_getaffinity(0)))
    rows = {
        "1 worker, 1 core": (1, cores[:1]),
        "1 worker": (1, cores),
        f"{len(cores)} workers": (len(cores), cores),
    }
    print(f"load {os.getloadavg()[0]:.1f} on {len(cores)} cores", file=sys.stderr)
    print(f"{'':18}{'core-seconds':>14}{'cores':>8}{'an hour':>9}{'of one core':>13}")
    first = 0.0
    for name, (jobs, held) in rows.items():
        core_s, used, rate = measure(order, words.episodes, jobs, held)
        first = first or rate
        print(f"{name:18}{core_s:14.2f}{used:8.2f}{rate:9.0f}{rate / first:13.2f}", flush=True)


if __name__ == "__main__":
    main()
