"""A process of `trocar` with all imports done, waiting for arguments.

`python -P -m webconsole.ready MODULE ...`: a line of the standard input has the arguments, a list in JSON. At
the end of the input, however the writer of the pipe has ended, the process ends as by SIGTERM. To import, and
to read the definitions of messages and kinds, takes two seconds, spent while a person still reads the form of
a fork.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from tempfile import NamedTemporaryFile
from time import sleep

__all__ = ["END_S", "ReadyProcess", "main"]

END_S = 60.0
"""Longest time for a session to close the recording and end the hosts, s: generous, for a busy machine, as a
killed hub leaves its secret behind.
"""


class ReadyProcess:
    """A process waiting for arguments, which ends with its parent process.

    Args:
        modules: Imported meanwhile; a failed import is left to the command to report.
    """

    def __init__(self, modules: Sequence[str]) -> None:
        with NamedTemporaryFile(delete=False) as file:
            self._file = Path(file.name)
            self._said = self._file.open("rb")
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "webconsole.ready", *modules],
                stdin=subprocess.PIPE,
                stdout=file,
                stderr=file,
                start_new_session=True,
            )
        with suppress(PermissionError):  # an open file of Windows keeps its name
            self._file.unlink()

    def read_output(self) -> str:
        """Return the output of the process so far."""
        self._said.seek(0)
        return self._said.read().decode(errors="replace")

    def run(self, arguments: Sequence[str]) -> subprocess.Popen[bytes]:
        """Let the process run `trocar` with these arguments, and return the process."""
        assert self.process.stdin is not None
        with suppress(BrokenPipeError):  # it has ended: its exit code tells how
            self.process.stdin.write(json.dumps([*arguments]).encode() + b"\n")
            self.process.stdin.flush()
        return self.process

    def close(self) -> None:
        """Let the process end."""
        assert self.process.stdin is not None
        with suppress(BrokenPipeError):
            self.process.stdin.close()
        self.process.wait()
        self._said.close()
        self._file.unlink(missing_ok=True)


def main() -> None:
    """Import, wait, and run the command."""
    for module in sys.argv[1:]:
        with suppress(Exception):  # a plug-in may raise anything; the command will say what
            import_module(module)
    _read_definitions()
    line = sys.stdin.readline()
    if not line:
        return
    pipe = os.dup(sys.stdin.fileno())
    with open(os.devnull) as nothing:  # noqa: PTH123
        os.dup2(nothing.fileno(), sys.stdin.fileno())
    threading.Thread(target=_end_with_pipe, args=(pipe,), name="parent", daemon=True).start()
    sys.argv = ["trocar", *json.loads(line)]
    from hub.command_line import main as command

    command()


def _end_with_pipe(pipe: int) -> None:
    """End this process when the writer closes a pipe: in order, so that a recording is whole."""
    while os.read(pipe, 1024):
        pass
    # a shell lets a program in the background, and so what that starts, ignore SIGINT
    os.kill(os.getpid(), signal.SIGTERM)
    sleep(END_S)
    os._exit(1)


def _read_definitions() -> None:
    """Read the definitions needed once in a process: messages, kinds and requirements."""
    from hub.planning import registry
    from schemas.codec import typestore

    typestore()
    for name in registry.kinds():
        registry.extra_packages(name)


if __name__ == "__main__":
    main()
