"""Mutated inputs in processes of their own: each is valid, or rejected with a sentence.

A reader rejects with a TrocarError; it may take some seconds and some memory. One process tries a batch of
cases where a reader is so fast that starting processes would take most of the time.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from select import select
from typing import Any

from schemas.errors import TrocarError

__all__ = ["Note", "Target", "search"]

LONGEST_S = 10.0
"""Of CPU time, for one input."""
LARGEST_MB = 100.0
"""Of memory, in addition to that of inputs that are not mutated."""
_PATIENCE_S = 30 * LONGEST_S
"""Of wall time, for one input, on a busy machine."""
_ADDRESS_SPACE = 8 * 2**30
"""Bytes of a process: a reader without bounds fails before it takes the machine's memory."""

Note = Callable[[str], None]
"""Is told what the input is and how it was mutated, before it is read."""


@dataclass(frozen=True)
class Target:
    """A kind of input, and its reader."""

    attempt: Callable[[str, Path, Note], None]
    """Make the input of a case, SEED:NUMBER, in an own directory, and read it."""
    pristine: Callable[[Path], None]
    """Read inputs that are not mutated."""
    prepare: Callable[[Path], None] | None = None
    """Import what the reader needs, before processes are forked; by default `pristine` does."""
    batch: int = 1
    """Cases that one process tries."""


@dataclass
class Tally:
    """What became of the inputs so far."""

    outcomes: Counter[str] = field(default_factory=Counter[str])
    slowest: tuple[float, str] = (0.0, "")
    largest: tuple[float, str] = (0.0, "")
    usual_kib: int = 0
    """Resident memory with inputs that are not mutated."""
    failed: list[str] = field(default_factory=list[str])

    def enter(self, what: str, result: str, problem: str, seconds: float, kib: int) -> bool:
        """Count an input that took `seconds` of CPU time, in a process of up to `kib` so far.

        Return whether it took too much memory.
        """
        megabytes = (kib - self.usual_kib) / 1024
        self.slowest = max(self.slowest, (seconds, what))
        self.largest = max(self.largest, (megabytes, what))
        if not problem and seconds > LONGEST_S:
            problem = f"took {seconds:.1f} s of CPU"
        if not problem and megabytes > LARGEST_MB:
            problem = f"took {megabytes:.0f} MB"
        self.outcomes["failed" if problem else result] += 1
        if problem:
            self.failed.append(f"{what}: {problem}")
        return megabytes > LARGEST_MB

    def __str__(self) -> str:
        outcomes = ", ".join(f"{number} {name}" for name, number in sorted(self.outcomes.items()))
        return (
            f"{self.outcomes.total()} tried: {outcomes}; slowest {self.slowest[0]:.2f} s of CPU"
            f" ({self.slowest[1]}), largest {self.largest[0]:.0f} MB ({self.largest[1]})"
        )


def search(target: Target, description: str, *, hours: float) -> int:
    """Search until the time or the number of inputs is reached; return 1 if one failed."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--number", type=int, default=1_000_000_000)
    parser.add_argument("--hours", type=float, default=hours)
    parser.add_argument("--case", help="SEED:NUMBER of one input")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder)
        (target.prepare or target.pristine)(directory)
        tally = Tally(usual_kib=_usual_kib(target, directory))
        end = time.monotonic() + 3600 * options.hours
        first = 0
        while first < options.number and time.monotonic() < end:
            last = min(first + target.batch, options.number)
            cases = [options.case] if options.case else [f"{options.seed}:{i}" for i in range(first, last)]
            first += _try_in_process(target, cases, directory, tally, end)
            if options.case:
                break
    sys.stdout.write("\n".join([*tally.failed, str(tally)]) + "\n")
    return 1 if tally.failed else 0


def _usual_kib(target: Target, directory: Path) -> int:
    """Return the peak memory of a process that reads what is not mutated."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            _quiet(directory)
            target.pristine(directory)
            code = 0
        except Exception:  # noqa: BLE001 - it is reported by the parent
            traceback.print_exc()
        finally:
            sys.stderr.flush()
            os._exit(code)
    _, status, used = os.wait4(child, 0)
    if status:
        raise RuntimeError(f"an input that is not mutated fails: {_said(directory)}")
    return used.ru_maxrss


def _try_in_process(target: Target, cases: Sequence[str], directory: Path, tally: Tally, end: float) -> int:
    """Try cases in a new process until `end`; return the number tried. A process that dies tries no more."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        _try_all(target, cases, directory, writer)
    os.close(writer)
    tried, what, stopped = 0, "", False
    for kind, *values in _lines(reader, child):
        if kind == "what":
            what = values[0]
            continue
        large = tally.enter(f"{cases[tried]}, {what}", *values)
        tried, what = tried + 1, ""
        if large or time.monotonic() > end:  # the peak would be that of all further cases, too
            stopped = True
            os.kill(child, signal.SIGKILL)
            break
    os.close(reader)
    _, status, used = os.wait4(child, 0)
    if tried < len(cases) and not stopped:
        how = f"the process ended with status {os.waitstatus_to_exitcode(status)}\n{_said(directory)}"
        tally.enter(f"{cases[tried]}, {what}", "failed", how, 0.0, used.ru_maxrss)
        tried += 1
    return tried


def _lines(reader: int, child: int) -> Iterator[list[Any]]:
    """Yield what a process writes; one that takes far too long is killed."""
    rest = b""
    while select([reader], [], [], _PATIENCE_S)[0]:
        part = os.read(reader, 65536)
        if not part:
            return
        *lines, rest = (rest + part).split(b"\n")
        yield from map(json.loads, lines)
    os.kill(child, signal.SIGKILL)


def _try_all(target: Target, cases: Sequence[str], directory: Path, writer: int) -> None:
    """Try cases and write what becomes of them; ends the process."""

    def write(*values: Any) -> None:
        os.write(writer, json.dumps(values).encode() + b"\n")

    code = 1
    try:
        _quiet(directory)
        resource.setrlimit(resource.RLIMIT_AS, (_ADDRESS_SPACE, _ADDRESS_SPACE))
        for case in cases:
            begun = time.process_time()
            found = _tried(target, case, directory, lambda what: write("what", what))
            seconds = time.process_time() - begun
            write("end", *found, seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
        code = 0
    finally:
        os._exit(code)


def _tried(target: Target, case: str, directory: Path, note: Note) -> tuple[str, str]:
    """Return the result of a case, and the problem if it is one."""
    try:
        target.attempt(case, directory, note)
    except TrocarError as error:
        text = str(error)
        fine = len(text.split()) > 2 and len(text) < 20_000
        return "rejected", "" if fine else f"no sentence: {type(error).__name__}: {text[:500]!r}"
    except Exception:  # noqa: BLE001 - any other one is what is looked for
        return "failed", traceback.format_exc()[-4000:]
    return "valid", ""


def _quiet(directory: Path) -> None:
    """Write what this process prints to a file."""
    file = os.open(directory / "said.txt", os.O_RDWR | os.O_CREAT | os.O_TRUNC)
    os.dup2(file, 1)
    os.dup2(file, 2)
    os.close(file)


def _said(directory: Path) -> str:
    return (directory / "said.txt").read_text(encoding="utf-8", errors="replace")[-3000:]
