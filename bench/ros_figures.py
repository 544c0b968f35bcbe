"""What the programs of `bench/ros.py` measure themselves and one another with."""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["cpu_s", "host_process"]


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
