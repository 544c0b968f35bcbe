"""The servo process and the watcher, from the device's side: start, send, receive, end.

Only `close` waits for the process.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from queue import Empty, SimpleQueue
from typing import Any

from devices.haptics.limits import Limits
from devices.haptics.servo.driver import StylusSpec
from devices.haptics.servo.exchange import RingReader, RingWriter, create, device_ends, memory_size
from devices.haptics.servo.watcher import HAS_KILLED

__all__ = ["DriverChoice", "ServoProcess"]

_PATIENCE_S, _WATCHER_PATIENCE_S = 1.0, 0.2
_NO_WINDOW: int = subprocess.CREATE_NO_WINDOW if sys.platform == "win32" else 0


@dataclass(frozen=True)
class DriverChoice:
    """Choice of the driver made by a servo process."""

    driver: str
    """Driver class, `module:Class`."""
    options: dict[str, Any]
    """Keyword arguments of the class, representable in JSON."""


class ServoProcess:
    """A running process with the devices of `specs`."""

    def __init__(self, driver: DriverChoice, specs: Sequence[StylusSpec]) -> None:
        """Start the process. Raises OSError if the system has no process left."""
        self.names = tuple(spec.name for spec in specs)
        size = memory_size(len(specs))
        shared, handle = create(size)
        ends = [device_ends(memoryview(shared), index) for index in range(len(specs))]
        self.models: dict[str, RingWriter] = {
            name: models for name, (models, _) in zip(self.names, ends, strict=True)
        }
        self.states: dict[str, RingReader] = {
            name: states for name, (_, states) in zip(self.names, ends, strict=True)
        }
        inherited = (handle,) if isinstance(handle, int) else ()
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "devices.haptics.servo.program"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                pass_fds=inherited,
                process_group=0,  # Ctrl-C is for this process, which then ends that one
                creationflags=_NO_WINDOW,
            )
            try:
                self._watcher = _watcher(handle, len(specs), self._process.pid)
            except OSError:
                self._process.kill()
                self._process.communicate()
                raise
        finally:
            for file in inherited:
                os.close(file)
        self._said: SimpleQueue[dict[str, Any]] = SimpleQueue()
        self._listener = threading.Thread(target=self._listen_to_process, name="servo process", daemon=True)
        self._listener.start()
        styluses = [asdict(spec) for spec in specs]
        self._send(asdict(driver) | {"memory": handle, "styluses": styluses})

    @property
    def pid(self) -> int:
        """Id of the process."""
        return self._process.pid

    @property
    def is_alive(self) -> bool:
        """Whether the process runs."""
        return self._process.poll() is None

    @property
    def was_killed_by_watcher(self) -> bool:
        """Whether the watcher killed a standing process with force on a hand; known after `close`."""
        return self._watcher.returncode == HAS_KILLED

    def read_messages(self, timeout_s: float = 0.0) -> list[dict[str, Any]]:
        """Return the messages since the last call; wait up to `timeout_s` for the first."""
        found: list[dict[str, Any]] = []
        with contextlib.suppress(Empty):
            if timeout_s:
                found.append(self._said.get(timeout=timeout_s))
            while True:
                found.append(self._said.get_nowait())
        return found

    def allow(self, stylus: str, limits: Limits, *, passivity: bool) -> None:
        """Allow force on the hand at `stylus`, within `limits`."""
        self._send({"stylus": stylus, "limits": asdict(limits), "passivity": passivity})

    def end(self) -> None:
        """Ask for a last frame without force, and for the end."""
        with contextlib.suppress(OSError):
            assert self._process.stdin
            self._process.stdin.close()

    def kill(self) -> None:
        """End the process at once. The end of the force depends on the driver."""
        self._process.kill()

    def close(self) -> None:
        """End the process and wait for the end."""
        self.end()
        try:
            self._process.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.kill()
            self._process.wait()
        try:
            self._watcher.wait(_WATCHER_PATIENCE_S)  # it ends by itself
        except subprocess.TimeoutExpired:
            self._watcher.kill()
            self._watcher.wait()
        self._listener.join()

    def _send(self, message: dict[str, Any]) -> None:
        assert self._process.stdin
        if self._process.stdin.closed:  # it was requested to end
            return
        with contextlib.suppress(OSError):  # it has ended: `is_alive` is False
            self._process.stdin.write(json.dumps(message) + "\n")
            self._process.stdin.flush()

    def _listen_to_process(self) -> None:
        assert self._process.stdout
        with self._process.stdout as lines:
            for line in lines:
                self._said.put(json.loads(line))
        self._said.put({"ended": True})


def _watcher(memory: int | str, styluses: int, pid: int) -> subprocess.Popen[bytes]:
    """Start the watcher of process `pid`, not yet reaped by the caller."""
    process = pid if sys.platform == "win32" else os.pidfd_open(pid)
    files = () if sys.platform == "win32" else (int(memory), process)
    try:
        return subprocess.Popen(
            [
                sys.executable,
                "-P",
                "-m",
                "devices.haptics.servo.watcher",
                *map(str, (memory, styluses, process)),
            ],
            stdin=subprocess.DEVNULL,
            pass_fds=files,
            process_group=0,  # as for the servo process
            creationflags=_NO_WINDOW,
        )
    finally:
        if sys.platform != "win32":
            os.close(process)
