"""Participants of swept scenarios; their processes find them through PYTHONPATH."""

import os
import signal
from pathlib import Path
from time import sleep

import numpy as np

from hub.participant import Params, Stepped
from schemas.ports import Port


class KilledParams(Params):
    mark: str = ""
    """A file that remembers the first time; empty to be killed every time."""
    until: float = 1.0
    """Killed only where `value` is not below."""
    value: float = 0.0
    forever: bool = False
    """Whether a step never ends."""


class Killed(Stepped):
    """Kills its own process in its first step, if it is not below its limit, and reports its value."""

    params_model = KilledParams
    ports = (Port(name="value", causality="output", size=1),)

    def configure(self, setup):
        return {"value": np.array([self.params.value])}

    def step(self, t, h, inputs):
        while self.params.forever:
            sleep(1.0)
        if self.params.value >= self.params.until and not (
            self.params.mark and Path(self.params.mark).exists()
        ):
            if self.params.mark:
                Path(self.params.mark).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return {"value": np.array([self.params.value])}

    def state_hash(self):
        return 0

    def close(self):
        pass
