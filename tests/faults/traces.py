"""What a session has on its machine: processes, abstract sockets, shared memory; Linux only."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path

__all__ = ["MARK", "Process", "lanes", "living", "segments"]

MARK = "TROCAR_FAULTS"
"""An environment variable that all processes of an attempt have, also those whose parent has ended."""

_MODULES = {
    "hub.hosting.host_process": "host",
    "hub.security.gate_process": "gate",
    "devices.openhaptics.servo": "servo",
    "devices.openhaptics.watcher": "watcher",
}


class Process:
    """A living process of an attempt."""

    def __init__(self, pid: int, command: list[str], started: int) -> None:
        self.pid, self.command, self.started = pid, command, started

    @property
    def part(self) -> str:
        """`hub`, `host NAME`, `device NAME`, `servo`, `watcher`, `gate`, or the command."""
        words = self.command
        for module, part in _MODULES.items():
            if module in words:
                return f"{part} {words[words.index('--host') + 1]}" if part == "host" else part
        if "hub.command_line" in words:
            verb = words[words.index("hub.command_line") + 1]
            return "hub" if verb == "run" else f"{verb} {words[words.index(verb) + 1]}"
        return " ".join(words) or "a process without a command"


def living(mark: str) -> dict[str, Process]:
    """Return the living processes whose environment has `MARK=mark`, by part; zombies are left out."""
    wanted, found = f"{MARK}={mark}".encode(), dict[str, Process]()
    for pid in _pids():
        with suppress(OSError):  # it has ended meanwhile
            if wanted not in Path(f"/proc/{pid}/environ").read_bytes().split(b"\0"):
                continue
            command = Path(f"/proc/{pid}/cmdline").read_bytes().decode().split("\0")[:-1]
            if command:
                process = Process(pid, command, 0)
                found[process.part] = process
    return found


def _pids() -> Iterator[int]:
    return (int(name) for name in os.listdir("/proc") if name.isdecimal())


def lanes(processes: Mapping[str, Process]) -> set[str]:
    """Return the abstract sockets that `processes` hold, by inode and name."""
    inodes: set[str] = set()
    for process in processes.values():
        with suppress(OSError):
            for file in Path(f"/proc/{process.pid}/fd").iterdir():
                with suppress(OSError):
                    inodes.add(os.readlink(file).removeprefix("socket:[").removesuffix("]"))
    return {lane for lane in abstract_sockets() if lane.split()[0] in inodes}


def abstract_sockets() -> set[str]:
    """Return all abstract sockets of this machine, by inode and name."""
    rows = (line.split() for line in Path("/proc/net/unix").read_text(encoding="utf-8").splitlines()[1:])
    return {f"{row[6]} {row[7]}" for row in rows if len(row) > 7 and row[7].startswith("@")}


def segments() -> set[str]:
    """Return the shared memory that Zenoh and Python's multiprocessing have on this machine."""
    return {path.name for pattern in ("*.zenoh", "psm_*") for path in Path("/dev/shm").glob(pattern)}
