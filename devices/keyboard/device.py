"""Keyboard or gamepad in place of a stylus or a headset (kind `keyboard`).

pygame-ce gives window, keys and gamepads on every desktop. The window is opened in the thread that reads.
"""

from __future__ import annotations

import os
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from pydantic import Field

from devices.diagnosis import Diagnosis, Level
from devices.keyboard.hand_ports import StandsFor, hand_ports
from devices.keyboard.virtual_stylus import VirtualStylus
from devices.samples import SampleTimer, button_sample, pose_sample, twist_sample
from hub.participant import Device, Params, Sample
from schemas.errors import DeviceError, MissingExtraError
from schemas.ports import Port
from schemas.quantity import Duration, Speed
from schemas.ros import Float64Message

if TYPE_CHECKING:
    from devices.keyboard.window import Window

__all__ = ["Keyboard", "KeyboardParams"]

_LONGEST_NS = 100_000_000
"""After a longer pause between reads the stylus moves for this time only: it must not leap."""


class KeyboardParams(Params):
    """What the keys move, and how fast it moves."""

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


class Keyboard(Device):
    """Publishes `pose`, `twist`, `buttons`, `gripper` and `diagnostics` like one stylus.

    While its window is not in focus, only the last. The moved frame starts at the origin of
    `<participant>_base`, pointing level away from the user; devices.keyboard.keys has the keys.
    """

    params_model: ClassVar[type[Params]] = KeyboardParams
    params: KeyboardParams

    def __init__(self, name: str, params: KeyboardParams) -> None:
        super().__init__(name, params)
        self._diagnosis = Diagnosis(name)
        self._pose, self._twist, self._buttons, self._gripper = hand_ports(
            name, params.stands_for, params.max_age
        )
        self._window: Window | None = None
        self._reset()

    def _reset(self) -> None:
        self._stylus = VirtualStylus(self.params.speed, self.params.turn_speed, self.params.stands_for)
        self._pressed = (False, False)
        self._timer, self._last_ns = SampleTimer(self.params.rate), 0

    @property
    def ports(self) -> tuple[Port, ...]:
        """`pose`, `twist`, `buttons`, `gripper` and `diagnostics`."""
        return self._pose, self._twist, self._buttons, self._gripper, self._diagnosis.port

    def open(self, directory: Path) -> None:  # noqa: ARG002
        """Start; the first `read` opens the window.

        Raises MissingExtraError if pygame is not installed.
        """
        if find_spec("pygame") is None:
            raise MissingExtraError(f"participant '{self.name}' (kind keyboard)", "keyboard", "pygame-ce")
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # it is printed otherwise
        # with its own handler SIGTERM would not end this process
        os.environ.setdefault("SDL_NO_SIGNAL_HANDLERS", "1")
        self._diagnosis = Diagnosis(self.name)
        self._reset()

    def read(self, t: int) -> list[Sample]:
        """Return the present pose and twist, the buttons and the diagnosis if they have changed."""
        if not self._timer.due(t):
            return []
        try:
            return self._samples(t, self._window or self._opened())
        except DeviceError as error:
            self.close()
            self._timer.failed(t)
            return self._diagnosis.report(Level.ERROR, f"{error}; the next try is in a second")

    def _opened(self) -> Window:
        from devices.keyboard.window import Window

        self._window = Window(self.name)
        return self._window

    def _samples(self, t: int, window: Window) -> list[Sample]:
        wish = window.wish()
        elapsed_ns, self._last_ns = min(t - self._last_ns, _LONGEST_NS), t
        samples: list[Sample] = []
        if (wish.dead_man, wish.jaw) != self._pressed:
            self._pressed = wish.dead_man, wish.jaw
            samples.append(button_sample(self._buttons, t, self._pressed))
        if not window.focused:
            return samples + self._diagnosis.report(
                Level.WARN, "keys are read only while the window of this device is in focus; click into it"
            )
        self._stylus.advance(wish, elapsed_ns * 1e-9)
        samples += self._diagnosis.report(Level.OK, "keys are read")
        samples += [
            pose_sample(self._pose, t, *self._stylus.pose),
            twist_sample(self._twist, t, *self._stylus.twist),
        ]
        return [*samples, Sample(self._gripper.name, Float64Message(data=self._stylus.gripper))]

    def close(self) -> None:
        """Close the window."""
        if self._window is not None:
            self._window.close()
        self._window = None
