"""Mutated scenarios through `trocar check`: each is valid, or rejected with exit code 2 and a sentence.

`python -m tests.fuzz.scenarios --hours 1 --seed 7` searches for longer than CI does; with `--case 7:123` it
repeats one scenario.
"""

from __future__ import annotations

import argparse
import faulthandler
import os
import random
import sys
import tempfile
import time
import traceback
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from select import select

from hub.command_line.app import main as trocar
from hub.planning.scenario_file import installed_scenarios, load
from hub.session.launch import plan_of
from tests.fuzz.scenario_mutations import mutated

LONGEST_S = 10.0
"""Of CPU time, for one scenario."""
LARGEST_MB = 100.0
"""Of memory, in addition to that of the check of a shipped scenario."""


@dataclass
class Tally:
    """What became of the scenarios so far."""

    outcomes: Counter[str] = field(default_factory=Counter[str])
    slowest: tuple[float, str] = (0.0, "")
    largest: tuple[float, str] = (0.0, "")
    usual_kib: int = 0
    """Resident memory of the check of a scenario that is not mutated."""
    failed: list[str] = field(default_factory=list[str])

    def __str__(self) -> str:
        outcomes = ", ".join(f"{number} {name}" for name, number in sorted(self.outcomes.items()))
        return (
            f"{self.outcomes.total()} tried: {outcomes}; slowest {self.slowest[0]:.2f} s of CPU"
            f" ({self.slowest[1]}), largest {self.largest[0]:.0f} MB ({self.largest[1]})"
        )


def attempt(case: str, directory: Path, tally: Tally) -> None:
    """Check the scenario of `case`, `SEED:NUMBER`, in a process of its own, and enter it in the tally."""
    random_source = random.Random(case)
    name, file = random_source.choice(sorted(installed_scenarios().items()))
    label, data, overrides = mutated(file.read_text(encoding="utf-8"), random_source)
    path = directory / "mutated.yaml"
    path.write_bytes(data)
    code, output, seconds, kib = _forked_check(path, overrides)
    megabytes = (kib - tally.usual_kib) / 1024
    what = f"{case}, {name}: {label}"
    tally.slowest = max(tally.slowest, (seconds, what))
    tally.largest = max(tally.largest, (megabytes, what))
    tally.outcomes[{0: "valid", 2: "rejected"}.get(code, "failed")] += 1
    problem = _problem(code, output, seconds, megabytes)
    if problem:
        tally.failed.append(f"{what}: {problem}\n{output[-3000:]}")


def _forked_check(path: Path, overrides: list[str]) -> tuple[int, str, float, int]:
    """Return exit code, errors, CPU time (s) and peak memory (KiB) of a check in a new process."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        _check(path, overrides, writer)
    os.close(writer)
    output = _read(reader, child)
    _, status, used = os.wait4(child, 0)
    return os.waitstatus_to_exitcode(status), output, used.ru_utime + used.ru_stime, used.ru_maxrss


def _problem(code: int, output: str, seconds: float, megabytes: float) -> str:
    if code not in (0, 2) or "Traceback" in output:
        return f"exit code {code}"
    if code == 2 and not output.startswith("error: "):
        return "no sentence"
    if seconds > LONGEST_S:
        return f"took {seconds:.1f} s of CPU"
    return f"took {megabytes:.0f} MB" if megabytes > LARGEST_MB else ""


def _read(reader: int, child: int) -> str:
    """Return what the child process wrote; a child that takes far too long is killed."""
    deadline, parts = time.monotonic() + 6 * LONGEST_S, list[bytes]()
    with open(reader, "rb", buffering=0) as pipe:
        while select([pipe], [], [], max(0.0, deadline - time.monotonic()))[0]:
            part = pipe.read(65536)
            if not part:
                return b"".join(parts).decode(errors="replace")
            parts.append(part)
    os.kill(child, 9)
    return b"".join(parts).decode(errors="replace") + "(killed)"


def _check(path: Path, overrides: list[str], writer: int) -> None:
    """Run `trocar check` as a command does, with its errors into `writer`, and end the process."""
    null = os.open(os.devnull, os.O_RDWR)
    os.dup2(null, 1)
    os.dup2(writer, 2)
    os.close(writer)  # or the pipe would stay open behind descriptor 2
    sys.argv = ["trocar", "check", str(path), *(part for text in overrides for part in ("--set", text))]
    code = 1
    try:
        trocar()
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    finally:
        if code == 1 and sys.exception():
            traceback.print_exc()
        sys.stderr.flush()
        os._exit(code)


def _warm() -> None:
    """Plan every installed scenario, to import what the mutated ones need before they are forked."""
    for name in installed_scenarios():
        file = load(name)
        plan_of(file.scenario, file.params)


def main() -> int:
    """Search until the time or the number of scenarios is reached; return 1 if one failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--number", type=int, default=1_000_000_000)
    parser.add_argument("--hours", type=float, default=15 / 3600)
    parser.add_argument("--case", help="SEED:NUMBER of one scenario")
    options = parser.parse_args()
    faulthandler.enable()
    _warm()
    tally = Tally(usual_kib=_forked_check(installed_scenarios()["palpation"], [])[3])
    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder)
        end = time.monotonic() + 3600 * options.hours
        for number in range(options.number):
            if time.monotonic() > end:
                break
            attempt(options.case or f"{options.seed}:{number}", directory, tally)
            if options.case:
                break
    sys.stdout.write("\n".join([*tally.failed, str(tally)]) + "\n")
    return 1 if tally.failed else 0


if __name__ == "__main__":
    sys.exit(main())
