"""The device of `bench/latency.py`: a hand that jumps and measures when the robot's tip starts to follow."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from pathlib import Path
from time import monotonic_ns

import numpy as np

from devices.samples import pose_sample
from hub.participant import Device, Params, Sample, Value
from schemas.ports import Port

POSE = "geometry_msgs/msg/PoseStamped"
WAY_M = 0.01
SMOOTH_M, JERK_M = 2e-7, 1e-6
"""Second difference of the tip's positions, step by step: below the one it goes on as it did, above the other
something new drives it. The first step after a jump makes 4e-6 m, the rest of the drives' settling less than
1e-7 m.
"""
SMOOTH_STEPS = 10


class TappingParams(Params):
    """Where the times go."""

    output: Path


class Tapping(Device):
    """Jumps by 10 mm once the tip moves smoothly, and records when the tip follows.

    The pauses between jumps are random, between 20 and 30 ms.
    """

    params_model = TappingParams
    params: TappingParams
    ports = (
        Port(
            name="pose",
            causality="output",
            type=POSE,
            frame="hand_base",
            clock="wall",
            max_age_ns=100_000_000,
        ),
        Port(name="state", causality="input", type=POSE),
    )

    def open(self, directory: Path) -> None:
        """Start at rest."""
        self._chance = random.Random(1)
        self._x, self._jumped_ns, self._due_ns = 0.0, 0, None
        self._tip = self._move = np.zeros(3)
        self._smooth = 0
        self._times_ns: list[int] = []

    def read(self, t: int) -> Iterator[Sample]:
        """Return where the hand is now."""
        now_ns = monotonic_ns()
        if self._smooth >= SMOOTH_STEPS and not self._jumped_ns:
            if self._due_ns is None:
                self._due_ns = now_ns + round(self._chance.uniform(20e6, 30e6))
            elif now_ns >= self._due_ns:
                self._x, self._jumped_ns, self._due_ns = WAY_M - self._x, now_ns, None
        yield pose_sample(self.ports[0], t, (self._x, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))

    def write(self, port: str, value: Value) -> None:
        """Take the pose of the tip: the first that changes its motion reflects the jump."""
        now_ns, tip = monotonic_ns(), np.asarray(value)[:3]
        move = tip - self._tip
        jerk = float(np.abs(move - self._move).max())
        self._tip, self._move = tip.copy(), move
        self._smooth = self._smooth + 1 if jerk < SMOOTH_M else 0
        if self._jumped_ns and jerk > JERK_M:
            self._times_ns.append(now_ns - self._jumped_ns)
            self._jumped_ns = 0

    def close(self) -> None:
        """Write the times down."""
        if hasattr(self, "_times_ns"):
            self.params.output.write_text(json.dumps(self._times_ns))
