"""A sweep of short trials against the same trials one after the other, as a loop of a shell runs them.

python bench/sweep.py --trials 64 --jobs 2

Both run in turns, `--rounds` times, so that what else the machine does meets both alike; the load stands
beside. A trial is 50 ms of `palpation` in one process, without a recording: mostly the start of Python.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

TROCAR = [sys.executable, "-P", "-m", "trocar"]
SETTINGS = ["--set", "duration=50 ms"]


def sweep(trials: int, jobs: int) -> float:
    """Return how long `trocar sweep` takes, s."""
    with TemporaryDirectory() as place:
        command = [*TROCAR, "sweep", "palpation", *SETTINGS, "--repeat", str(trials), "--no-record"]
        return timed([[*command, "--jobs", str(jobs), "-o", str(Path(place) / "results")]])


def loop(trials: int) -> float:
    """Return how long the trials take one after the other, s."""
    return timed([[*TROCAR, "run", "palpation", *SETTINGS, "--pace", "fast", "--json"]] * trials)


def timed(commands: list[list[str]]) -> float:
    begin = time.perf_counter()
    for command in commands:
        subprocess.run(command, check=True, capture_output=True)
    return time.perf_counter() - begin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=64)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=1)
    chosen = parser.parse_args()
    for _ in range(chosen.rounds):
        swept, looped = sweep(chosen.trials, chosen.jobs), loop(chosen.trials)
        print(f"{chosen.trials} trials: loop {looped:.1f} s, sweep {swept:.1f} s, {looped / swept:.2f} x;")
        print(f"load {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
