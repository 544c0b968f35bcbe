"""Participants of the sessions in which parts are killed; their processes find them through PYTHONPATH."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np

from hub.participant import Device, Params, Sample, Stepped, state_hash
from schemas.ports import Port
from schemas.ros import Pose, PoseStamped

POSE = PoseStamped.ros_type
_HOLDING = ctypes.PyDLL(None)
"""Calls of it keep Python's interpreter lock, as those of PyBullet do."""


class EngineParams(Params):
    seed: int = 1
    configure_ms: int = 0
    """How long `configure` computes, without a line of Python in between."""
    long_step: int = -1
    long_step_ms: int = 0
    """The step of this number takes this long, in the same way."""
    hand: bool = False
    """It reads a hand."""
    running: str = ""
    """A file that is made in the first step."""


class Engine(Stepped):
    """Folds an input into a chaotic state and publishes it; now and then it computes for long."""

    params_model = EngineParams

    @property
    def ports(self):
        hand = [Port(name="hand", causality="input", type=POSE)] if self.params.hand else []
        return (
            Port(name="a", causality="input", size=3, start=(0.25,) * 3),
            Port(name="out", causality="output", size=3),
            *hand,
        )

    def configure(self, setup):
        _HOLDING.usleep(self.params.configure_ms * 1000)
        self.x, self.steps = np.random.default_rng(self.params.seed).random(3), 0
        return {"out": self.x}

    def step(self, t, h, inputs):
        if self.steps == 0 and self.params.running:
            Path(self.params.running).touch()
        if self.steps == self.params.long_step:
            _HOLDING.usleep(self.params.long_step_ms * 1000)
        self.steps += 1
        self.x[:] = (3.9 * self.x * (1.0 - self.x) + 0.1 * inputs["a"]) % 1.0
        return {"out": self.x}

    def state_hash(self):
        return state_hash(self.x)

    def close(self):
        pass


class Hand(Device):
    """A pose whenever it is read."""

    ports = (Port(name="pose", causality="output", type=POSE, clock="wall", max_age_ns=100_000_000),)

    def open(self, directory):
        pass

    def read(self, t):
        return [Sample("pose", PoseStamped(pose=Pose()))]

    def close(self):
        pass
