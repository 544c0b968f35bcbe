"""Participants of `bench/ros.py`: pictures that nobody draws, and a watch on a joint."""

from __future__ import annotations

import json
from pathlib import Path
from time import time_ns

import numpy as np

from bench.ros_figures import MOVED_RAD
from hub.participant import Inputs, Outputs, Params, Setup, Stepped, state_hash
from schemas.ports import Port
from schemas.ros import Header, Image, JointState

HEIGHT, WIDTH = 288, 320
EYES = ("left", "right")


def picture(number: int) -> Image:
    """Return a picture of noise, 276 kB."""
    pixels = np.random.default_rng(number).integers(0, 256, HEIGHT * WIDTH * 3, np.uint8)
    return Image(
        header=Header(frame_id="left_optical"),
        height=HEIGHT,
        width=WIDTH,
        encoding="rgb8",
        step=3 * WIDTH,
        data=pixels,
    )


class Pictures(Stepped):
    """A stereo camera that shows the same eight pictures over and over."""

    ports = tuple(
        Port(name=f"{eye}/image_raw", causality="output", type=Image.ros_type, variability="event")
        for eye in EYES
    )

    def configure(self, setup: Setup) -> Outputs:
        self._pictures, self._count = [picture(number) for number in range(8)], np.zeros(1)
        return {port.name: () for port in self.ports}

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        self._count += 1
        return {port.name: (self._pictures[int(self._count[0]) % 8],) for port in self.ports}

    def state_hash(self) -> int:
        return state_hash(self._count)

    def close(self) -> None:
        pass


class StopwatchParams(Params):
    """Where the times go."""

    output: Path


class Stopwatch(Stepped):
    """Records the wall time until a `servo_jp` is executed, and until its joint moves.

    Both are from the command's stamp to the end of the step.
    """

    params_model = StopwatchParams
    params: StopwatchParams
    ports = (
        Port(name="servo_jp", causality="input", type=JointState.ros_type, variability="event"),
        Port(name="setpoint", causality="input", type=JointState.ros_type, size=6),
        Port(
            name="measured",
            causality="input",
            type=JointState.ros_type,
            size=6,
            fields=("position", "velocity", "effort"),
        ),
    )

    def configure(self, setup: Setup) -> Outputs:
        self._sent_ns: int | None = None
        self._before = self._now = np.zeros(2)
        self._times: dict[str, list[int]] = {"heeded": [], "moving": []}
        return {}

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        now_ns, before = time_ns(), self._now
        self._now = np.array([inputs["setpoint"][0], inputs["measured"][0]])
        for message in inputs.events("servo_jp"):
            if isinstance(message, JointState):
                self._sent_ns, self._before, self._seen = message.header.stamp.ns, before, set[str]()
        if self._sent_ns is not None:
            for name, way in zip(self._times, np.abs(self._now - self._before).tolist(), strict=True):
                if way > MOVED_RAD and name not in self._seen:
                    self._seen.add(name)
                    self._times[name].append(now_ns - self._sent_ns)
        return {}

    def state_hash(self) -> int:
        return 0

    def close(self) -> None:
        if hasattr(self, "_times"):
            self.params.output.write_text(json.dumps(self._times))
