"""A device: a sine, as a hand would lead it. By the simulated clock, or by that on the wall."""

from collections.abc import Iterator
from math import pi, sin
from pathlib import Path
from typing import Literal

from trocar import Device, Params, Port, Sample, signal_out
from trocar.messages import Float64Message
from trocar.quantities import Angle, Duration

SAMPLE_NS = 4_000_000


class WaveParams(Params):
    """Of the wave, in a scenario."""

    amplitude: Angle = 0.2  # rad
    period: Duration = 1_000_000_000  # ns
    clock: Literal["simulated", "wall"] = "simulated"


class Wave(Device):
    """`value` is amplitude sin(2 pi t / period), 250 times a second."""

    params_model = WaveParams

    @property
    def ports(self) -> tuple[Port, ...]:
        return (signal_out("value", Float64Message, unit="rad", clock=self.params.clock),)

    def open(self, directory: Path) -> None:
        self.next_ns = 0

    def read(self, t: int) -> Iterator[Sample]:
        while self.next_ns <= t:
            angle = 2 * pi * self.next_ns / self.params.period
            yield Sample("value", Float64Message(data=self.params.amplitude * sin(angle)))
            self.next_ns += SAMPLE_NS

    def close(self) -> None:
        """Nothing is held."""
