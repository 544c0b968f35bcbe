"""A hand without a person's arm: the common part of keys, gamepads and pages."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from devices.diagnosis import Diagnosis
from devices.keyboard.hand_ports import StandsFor, hand_ports
from devices.keyboard.virtual_stylus import VirtualStylus, Wish
from devices.samples import SampleTimer, button_sample, pose_sample, twist_sample
from hub.participant import Device, Params, Sample
from schemas.ports import Port
from schemas.quantity import Duration, Speed
from schemas.ros import Float64Message

__all__ = ["VirtualHand", "VirtualHandParams"]


class VirtualHandParams(Params):
    """Axes, speed and rate of a virtual hand."""

    open_to_pages: ClassVar[bool] = True

    stands_for: Annotated[
        StandsFor,
        Field(
            description="whose axes the moved frame has: a stylus', z out of its point, or a head's, x ahead"
        ),
    ] = "stylus"
    speed: Annotated[Speed, Field(gt=0.0, le=1.0, description="of the stylus' tip, at most")] = 0.1
    turn_speed: Annotated[float, Field(gt=0.0, le=10.0, description="of the stylus, at most, rad/s")] = 1.0
    rate: Annotated[float, Field(gt=0.0, le=1000.0, description="samples per second at most")] = 250.0
    max_age: Annotated[Duration, Field(gt=0, description="a pose or twist that is older is marked stale")] = (
        100_000_000
    )


class VirtualHand(Device):
    """Ports, stylus and timer of a virtual hand; a kind reads the commands to the hand."""

    longest_pause_ns: ClassVar[int]
    """Longest motion of the stylus after a pause between reads, ns: the stylus must not leap."""

    def __init__(self, name: str, params: VirtualHandParams) -> None:
        super().__init__(name, params)
        self._diagnosis = Diagnosis(name)
        self._pose, self._twist, self._buttons, self._gripper = hand_ports(
            name, params.stands_for, params.max_age
        )
        self._reset()

    def _reset(self) -> None:
        """Start with the stylus at the origin of the base frame, nothing pressed."""
        self._stylus = VirtualStylus(self.params.speed, self.params.turn_speed, self.params.stands_for)
        self._pressed = (False, False, False, False)
        self._timer, self._last_ns = SampleTimer(self.params.rate), 0

    @property
    def ports(self) -> tuple[Port, ...]:
        """`pose`, `twist`, `buttons`, `gripper` and `diagnostics`."""
        return self._pose, self._twist, self._buttons, self._gripper, self._diagnosis.port

    def _elapse(self, t: int) -> float:
        """Return the time since the last read, s."""
        elapsed_ns, self._last_ns = min(t - self._last_ns, self.longest_pause_ns), t
        return elapsed_ns * 1e-9

    def _press(self, t: int, wish: Wish) -> list[Sample]:
        """Return the sample of changed buttons."""
        pressed = wish.dead_man, wish.jaw, wish.pedal, wish.rinse
        if pressed == self._pressed:
            return []
        self._pressed = pressed
        return [button_sample(self._buttons, t, pressed)]

    def _motion(self, t: int) -> list[Sample]:
        """Return pose, twist and gripper of the stylus."""
        return [
            pose_sample(self._pose, t, *self._stylus.pose),
            twist_sample(self._twist, t, *self._stylus.twist),
            Sample(self._gripper.name, Float64Message(data=self._stylus.gripper)),
        ]
