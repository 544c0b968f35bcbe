"""A participant that kills the process that draws, as a driver that aborts does."""

import os
from pathlib import Path

from hub.participant import Params, Stepped


class KillerParams(Params):
    at: float
    """s."""
    signal: int
    """0: none."""
    session: int
    """The process of the session."""


class Killer(Stepped):
    params_model = KillerParams
    ports = ()

    def configure(self, setup):
        return {}

    def step(self, t, h, inputs):
        if t == round(self.params.at * 1e9):
            for process in _drawing(self.params.session):
                os.kill(process, self.params.signal)
        return {}

    def state_hash(self):
        return 0

    def save(self):
        return b""

    def restore(self, state):
        pass

    def close(self):
        pass


def _drawing(session):
    """Return the processes that draw for a session."""
    found = [int(file.name) for file in Path("/proc").iterdir() if file.name.isdigit()]
    return [one for one in found if "drawing_process" in _read(one, "cmdline") and session in _parents(one)]


def _read(process, what):
    try:
        return Path(f"/proc/{process}/{what}").read_text()
    except OSError:  # it has ended
        return ""


def _parents(process):
    while process > 1:
        status = _read(process, "stat").rpartition(")")[2].split()
        process = int(status[1]) if status else 0
        yield process
