"""A process of `trocar` that has imported what it needs, and waits for its arguments.

`python -P -m webconsole.ready MODULE ...`: a line of its standard input has the arguments, a list in JSON; at
the end of the input without one it ends. To import, and to read the definitions of messages and kinds,
takes two seconds, which is done while a person still reads the form of a fork.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from typing import IO

__all__ = ["ReadyProcess", "main"]


class ReadyProcess:
    """A process that waits for its arguments.

    Args:
        modules: What it imports; one that cannot be imported is left to the command, which says why.
        said: Where it writes what it says.
    """

    def __init__(self, modules: Sequence[str], said: IO[bytes]) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "webconsole.ready", *modules],
            stdin=subprocess.PIPE,
            stdout=said,
            stderr=said,
            start_new_session=True,
        )

    def run(self, arguments: Sequence[str]) -> subprocess.Popen[bytes]:
        """Let it run `trocar` with these arguments, and return it."""
        assert self.process.stdin is not None
        with suppress(BrokenPipeError):  # it has ended: its exit code tells how
            self.process.stdin.write(json.dumps([*arguments]).encode() + b"\n")
            self.process.stdin.close()
        return self.process

    def close(self) -> None:
        """Let it end without arguments."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()


def main() -> None:
    """Import, wait, and run the command."""
    for module in sys.argv[1:]:
        with suppress(Exception):  # a plug-in may raise anything; the command will say what
            import_module(module)
    _read_definitions()
    line = sys.stdin.readline()
    if not line:
        return
    with open(os.devnull) as nothing:  # noqa: PTH123
        os.dup2(nothing.fileno(), sys.stdin.fileno())
    sys.argv = ["trocar", *json.loads(line)]
    from hub.command_line import main as command

    command()


def _read_definitions() -> None:
    """Read what is read once in a process: messages, kinds and what they require."""
    from hub.planning import registry
    from schemas.codec import typestore

    typestore()
    for name in registry.kinds():
        registry.extra_packages(name)


if __name__ == "__main__":
    main()
