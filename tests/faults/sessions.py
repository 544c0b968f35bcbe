"""Sessions of which a part is killed, stopped or cut off at a random moment: each must end as it should.

`python -m tests.faults.sessions --number 200 --seed 7` tries more than CI does, with `--busy 2` beside two
processes that keep a core busy each; `--case 7:123` repeats one attempt. One takes 3 to 4 s of two cores.
"""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import monotonic

from tests.devices.standins import build
from tests.faults.attempt import Result, attempt
from tests.faults.faults import fault_of
from tests.faults.running_session import LIBRARY


def main() -> int:
    """Try until the time or the number of attempts is reached; return 1 if one went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--number", type=int, default=1_000_000_000)
    parser.add_argument("--hours", type=float, default=1_000_000.0)
    parser.add_argument("--busy", type=int, default=0, help="processes that keep a core busy each")
    parser.add_argument("--only", default="", help="text that must be in the fault, such as 'kill hub, run'")
    parser.add_argument("--case", nargs="+", default=[], help="SEED:NUMBER of attempts")
    options = parser.parse_args()
    results: list[Result] = []
    end = monotonic() + 3600 * options.hours
    with _standin(), _busy(options.busy):
        for case in options.case or (f"{options.seed}:{number}" for number in range(1_000_000_000)):
            if len(results) >= options.number or monotonic() > end:
                break
            fault = fault_of(random.Random(case))
            if options.only not in str(fault):
                continue
            with tempfile.TemporaryDirectory() as folder:
                result = attempt(f"{os.getpid()} {case}", fault, Path(folder))
            results.append(result)
            sys.stdout.write(_row(case, result))
            sys.stdout.flush()
    sys.stdout.write(_summary(results))
    return 1 if any(result.problems for result in results) else 0


@contextmanager
def _standin() -> Iterator[None]:
    if build.USABLE:
        build.compile_library("hd.c", LIBRARY)
    try:
        yield
    finally:
        LIBRARY.unlink(missing_ok=True)


@contextmanager
def _busy(number: int) -> Iterator[None]:
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(number)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def _row(case: str, result: Result) -> str:
    named = "" if result.named_ms is None else f"named after {result.named_ms:.0f} ms"
    times = f"ended {result.ended_ms:5.0f}, outlived {result.outlived_ms:4.0f} ms"
    row = f"{case:8} {result.fault!s:58} {named:20} {times}  code {result.code!s:4} {result.recording}\n"
    problems = "".join(f"    PROBLEM {problem}\n" for problem in result.problems)
    return (
        row + problems + ("".join(f"    | {line}\n" for line in result.log.splitlines()) if problems else "")
    )


def _summary(results: Sequence[Result]) -> str:
    kills = [
        result.named_ms
        for result in results
        if result.fault.action == "kill" and not result.fault.may_not_join
    ]
    named = [ms for ms in kills if ms is not None]
    hub = [result.outlived_ms for result in results if result.fault.kills_hub]
    failed = sum(1 for result in results if result.problems)
    load = ", ".join(f"{load:.1f}" for load in os.getloadavg())
    return (
        f"{len(results)} attempts, {failed} with problems; load {load}\n"
        f"killed parts were named after (ms): {_percentiles(named)}\n"
        f"the last process outlived a hub that was killed by (ms): {_percentiles(hub)}\n"
    )


def _percentiles(numbers: Sequence[float]) -> str:
    if not numbers:
        return "none"
    ranked = sorted(numbers)
    at = {f"p{part}": ranked[(len(ranked) - 1) * part // 100] for part in (50, 90, 99, 100)}
    return ", ".join(f"{name} {number:.0f}" for name, number in at.items()) + f" ({len(ranked)})"


if __name__ == "__main__":
    sys.exit(main())
