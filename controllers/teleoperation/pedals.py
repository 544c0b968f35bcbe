"""Pedals beside a hand: power of the generator, suction and saline, at the instrument that the arm holds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from controllers.teleoperation.params import TeleoperationParams
from hub.participant import Record, array, flag, signal_out
from robots.dvrk.end_effectors.suction_tube import SuctionTube
from schemas.ports import Port
from schemas.ros import Joy
from schemas.vectors import Vector

__all__ = ["Pedals"]

Pedal = Literal["pedal", "rinse"]

_PEDALS: Mapping[str, Pedal] = {"energy": "pedal", "suction": "pedal", "irrigation": "rinse"}
"""Outputs, and the button of each."""


class PedalState(Record):
    """Buttons as pressed, and outputs."""

    pedal = flag()
    rinse = flag()
    energy = array(1)
    """W."""
    suction = array(1)
    """Share of the most, as `irrigation`."""
    irrigation = array(1)


class Pedals:
    """Levels of generator and suction irrigator, 0 unless the arm follows with the pedal down."""

    def __init__(self, params: TeleoperationParams) -> None:
        self._buttons = params.buttons
        self._levels = [_levels(one) for one in params.variants]
        self._given = sorted({output for levels in self._levels for output in levels})
        now = PedalState()
        self._now, self.state = now, (now,) if self._given else ()
        self.outputs: dict[str, Vector] = {output: now.part(output) for output in self._given}

    @property
    def ports(self) -> tuple[Port, ...]:
        """An output for each action of the instruments that the arm may hold."""
        return tuple(
            signal_out("energy", description="power of the generator", unit="W")
            if output == "energy"
            else signal_out(output, description="share of the most")
            for output in self._given
        )

    def receive(self, joy: Joy) -> None:
        """Read the pedals; a Joy without a pedal's button changes nothing."""
        for pedal in ("pedal", "rinse"):
            button: int = getattr(self._buttons, pedal)
            if joy.buttons.size > button:
                setattr(self._now, pedal, bool(joy.buttons[button] != 0))

    def step(self, instrument: int, *, follows: bool) -> None:
        """Set the outputs for the held instrument: 0 the mounted one, 1 the first spare."""
        levels = self._levels[instrument]
        for output, value in self.outputs.items():
            pressed = follows and getattr(self._now, _PEDALS[output])
            value[:] = levels.get(output, 0.0) if pressed else 0.0


def _levels(params: TeleoperationParams) -> dict[str, float]:
    """Return the outputs of an instrument with their levels while the pedal is down."""
    if params.tool.energy is not None:
        return {"energy": params.power}
    return {"suction": 1.0, "irrigation": 1.0} if isinstance(params.tool.end_effector, SuctionTube) else {}
