"""Sessions of which a part is killed, stopped or cut off at a random moment: each ends as it must.

`python -m tests.faults.sessions --number 200 --seed 7` tries more than CI does; `--busy 2` starts two
processes that keep a core busy each; `--case 7:123` repeats one attempt.
"""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
import tempfile
from pathlib import Path
from time import monotonic

from tests.devices.standins import build
from tests.faults.attempt import LIBRARY, Result, attempt, fault_of


def main() -> int:
    """Try until the time or the number of attempts is reached; return 1 if one went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--number", type=int, default=1_000_000_000)
    parser.add_argument("--hours", type=float, default=1000.0)
    parser.add_argument("--busy", type=int, default=0)
    parser.add_argument("--only", default="", help="text that the fault must contain")
    parser.add_argument("--case", help="SEED:NUMBER of one attempt")
    options = parser.parse_args()
    results: list[Result] = []
    if build.USABLE:
        build.compile_library("hd.c", LIBRARY)
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(options.busy)]
    end = monotonic() + 3600 * options.hours
    try:
        number = -1
        while len(results) < options.number and monotonic() < end:
            number += 1
            case = options.case or f"{options.seed}:{number}"
            fault = fault_of(random.Random(case))
            if options.only not in str(fault) and not options.case:
                continue
            begun = monotonic()
            with tempfile.TemporaryDirectory() as folder:
                result = attempt(f"{os.getpid()} {case}", fault, Path(folder))
            results.append(result)
            show(case, result, monotonic() - begun)
            if options.case:
                break
    finally:
        for process in busy:
            process.kill()
            process.wait()
    return summary(results)


def show(case: str, result: Result, took_s: float) -> None:
    named = "-" if result.named_ms is None else f"{result.named_ms:.0f} ms"
    row = f"{case:8} {result.fault!s:52} named {named:8} code {result.code!s:4} outlived {result.outlived_ms:5.0f} ms  {result.recording:24} {took_s:.1f} s"
    sys.stdout.write(row + "".join(f"\n    PROBLEM {problem}" for problem in result.problems) + "\n")
    if result.problems:
        sys.stdout.write("".join(f"    | {line}\n" for line in result.log.splitlines()[-40:]))
    sys.stdout.flush()


def summary(results: list[Result]) -> int:
    named = sorted(
        r.named_ms
        for r in results
        if r.named_ms is not None and r.fault.action == "kill" and r.fault.is_named
    )
    outlived = sorted(r.outlived_ms for r in results)
    bad = sum(1 for r in results if r.problems)

    def at(values, q):
        return f"{values[min(int(q * len(values)), len(values) - 1)]:.0f}" if values else "-"

    sys.stdout.write(
        f"{len(results)} attempts, {bad} with problems; kills named after p50 {at(named, 0.5)}, p90 {at(named, 0.9)}, max {at(named, 1)} ms ({len(named)});"
        f" outlived max {at(outlived, 1)} ms; load {os.getloadavg()}\n"
    )
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
