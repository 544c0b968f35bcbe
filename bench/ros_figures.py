"""What the programs of `bench/ros.py` measure themselves and one another with."""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["MOVED_RAD", "cpu_s", "host_process", "percentiles"]

MOVED_RAD = 1e-7
"""An arm that holds still does not move by 1e-13 rad; the drives move the yaw by some 1e-7 rad in the first
step of 2 ms.
"""


def cpu_s(process: int | str = "self") -> float:
    """Return the CPU time of a process so far, user and kernel (s): utime and stime of proc(5)."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def host_process(host: str) -> int:
    """Return the process of a session's host among our children. Raises LookupError if there is none."""
    for task in Path("/proc/self/task").iterdir():
        for child in (task / "children").read_text().split():
            if f"--host\0{host}\0" in Path(f"/proc/{child}/cmdline").read_text():
                return int(child)
    raise LookupError(f"no process of host '{host}'")


def percentiles(times_ns: list[int]) -> dict[str, float]:
    """Return p50, p99 and the largest, in ms."""
    ordered = sorted(times_ns)
    if not ordered:
        return {"count": 0}
    picked = {
        "p50_ms": ordered[len(ordered) // 2],
        "p99_ms": ordered[min(len(ordered) - 1, len(ordered) * 99 // 100)],
        "max_ms": ordered[-1],
    }
    return {"count": len(ordered)} | {name: round(value / 1e6, 3) for name, value in picked.items()}
