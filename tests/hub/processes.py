"""The processes of a session, as the operating system lists them."""

import os
from pathlib import Path


def processes(endpoint):
    """Return the command lines of the other living processes that name `endpoint`."""
    return list(_commands(endpoint).values())


def hosts(endpoint):
    """Return the process ids of the living hosts that joined at `endpoint`."""
    return [
        number for number, command in _commands(endpoint).items() if "hub.hosting.host_process" in command
    ]


def _commands(endpoint):
    found = {}
    for entry in Path("/proc").iterdir():
        try:
            command = (entry / "cmdline").read_bytes().decode() if entry.name.isdecimal() else ""
        except OSError:
            continue
        if endpoint in command and entry.name != str(os.getpid()):
            found[int(entry.name)] = command
    return found
