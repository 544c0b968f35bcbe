"""What a session has on its machine: processes, abstract sockets, shared memory. Linux only."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

__all__ = ["MARK", "Process", "held", "living", "remaining"]

MARK = "TROCAR_FAULTS"
"""An environment variable that all processes of an attempt have, also those whose parent has ended."""

_MODULES = {
    "hub.security.gate_process": "gate",
    "devices.haptics.servo.program": "servo",
    "devices.haptics.servo.watcher": "watcher",
}


@dataclass(frozen=True)
class Process:
    """A living process of an attempt."""

    pid: int
    command: tuple[str, ...]

    @property
    def part(self) -> str:
        """`hub`, `host NAME`, `device NAME`, `gate`, `servo`, `watcher`, or the command of another one."""
        words = self.command
        if "hub.hosting.host_process" in words:
            return f"host {words[words.index('--host') + 1]}"
        if "hub.command_line" in words:
            verb, name = words[words.index("hub.command_line") + 1 :][:2]
            return "hub" if verb == "run" else f"{verb} {name}"
        return next((part for module, part in _MODULES.items() if module in words), " ".join(words))


def living(mark: str) -> list[Process]:
    """Return the living processes whose environment has `MARK=mark`; zombies are left out."""
    wanted, found = f"{MARK}={mark}".encode(), list[Process]()
    for folder in _processes():
        with suppress(OSError):  # it has ended meanwhile
            if wanted in (folder / "environ").read_bytes().split(b"\0"):
                command = (folder / "cmdline").read_bytes().decode().split("\0")[:-1]
                found.append(Process(int(folder.name), tuple(command)))
    return [process for process in found if process.command]


def _processes() -> Iterator[Path]:
    return (folder for folder in Path("/proc").iterdir() if folder.name.isdecimal())


def held(mark: str) -> set[str]:
    """Return the abstract sockets and the named shared memory that the processes of an attempt have now."""
    inodes, names = set[str](), set[str]()
    for process in living(mark):
        folder = Path(f"/proc/{process.pid}")
        with suppress(OSError):
            for file in (folder / "fd").iterdir():
                with suppress(OSError):
                    inodes.add(os.fspath(file.readlink()).removeprefix("socket:[").removesuffix("]"))
            names |= {line.split()[-1] for line in (folder / "maps").read_text().splitlines()}
    sockets = {socket for socket in _abstract_sockets() if socket.partition(" ")[0] in inodes}
    return sockets | {name for name in names if name.startswith("/dev/shm/")}


def remaining(things: set[str]) -> set[str]:
    """Return those of `things`, as `held` has found them, that are still there."""
    files = {thing for thing in things if thing.startswith("/") and Path(thing).exists()}
    return files | (things & _abstract_sockets())


def _abstract_sockets() -> set[str]:
    rows = (line.split() for line in Path("/proc/net/unix").read_text().splitlines()[1:])
    return {f"{row[6]} {row[7]}" for row in rows if len(row) > 7 and row[7].startswith("@")}
