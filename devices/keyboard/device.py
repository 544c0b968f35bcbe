"""Keyboard or gamepad as a stylus or a head (kind `keyboard`), for people who have neither stylus nor
headset.

pygame-ce gives window, keys and gamepads on every desktop. The window is opened in the thread that reads.
"""

from __future__ import annotations

import os
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from devices.diagnosis import Diagnosis, Level
from devices.keyboard.virtual_stylus import VirtualStylus
from devices.pace import Pace
from devices.samples import button_sample, pose_sample, twist_sample
from hub.participant import Device, Params, Sample
from schemas.errors import DeviceError, MissingExtraError
from schemas.ports import Port
from schemas.quantity import Duration, Speed
from schemas.ros import Float64Message

if TYPE_CHECKING:
    from devices.keyboard.window import Window

__all__ = ["Keyboard", "KeyboardParams"]

_LONGEST_NS = 100_000_000
"""If nobody read for longer, the stylus goes on as if it had been this long: it must not leap."""

_FRAMES = {
    "stylus": "of the tip; z out of the point, x to the right when it points away from the user",
    "head": "of the head: x ahead, y to the left, z up",
}


class KeyboardParams(Params):
    """What the keys move, and how fast."""

    stands_for: Annotated[
        Literal["stylus", "head"],
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
    """Publishes `pose`, `twist`, `buttons`, `gripper` and `diagnostics` like one stylus; nothing but the last
    while its window is not in focus.

    What is moved starts at the origin of `<participant>_base`, pointing level away from the user;
    devices.keyboard.keys has the keys.
    """

    params_model: ClassVar[type[Params]] = KeyboardParams
    params: KeyboardParams

    def __init__(self, name: str, params: KeyboardParams) -> None:
        """Take the participant's name and its parameters."""
        super().__init__(name, params)
        self._diagnosis = Diagnosis(name)
        frame = f"{name}_base"
        self._pose, self._twist = (
            Port(
                name=port,
                causality="output",
                type=type_,
                frame=frame,
                max_age_ns=params.max_age,
                clock="wall",
                description=text,
            )
            for port, type_, text in (
                ("pose", "geometry_msgs/msg/PoseStamped", _FRAMES[params.stands_for]),
                ("twist", "geometry_msgs/msg/TwistStamped", "of the same, along the axes of the base frame"),
            )
        )
        told = "each press and release: 0 the dead-man, 1 the jaw"
        self._buttons = Port(
            name="buttons",
            causality="output",
            type="sensor_msgs/msg/Joy",
            variability="event",
            frame=frame,
            clock="wall",
            description=told,
        )
        self._gripper = Port(
            name="gripper",
            causality="output",
            type="std_msgs/msg/Float64",
            clock="wall",
            description="0 closed, 1 open",
        )
        self._window: Window | None = None
        self._begin()

    def _begin(self) -> None:
        self._stylus = VirtualStylus(self.params.speed, self.params.turn_speed, self.params.stands_for)
        self._pressed = (False, False)
        self._pace, self._last_ns = Pace(self.params.rate), 0

    @property
    def ports(self) -> tuple[Port, ...]:
        """`pose`, `twist`, `buttons`, `gripper` and `diagnostics`."""
        return self._pose, self._twist, self._buttons, self._gripper, self._diagnosis.port

    def open(self, directory: Path) -> None:  # noqa: ARG002
        """Begin anew; the window is opened by the first `read`.

        Raises MissingExtraError where pygame is not installed.
        """
        if find_spec("pygame") is None:
            raise MissingExtraError(f"participant '{self.name}' (kind keyboard)", "keyboard", "pygame-ce")
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # which it would print
        # with its own a SIGTERM would no longer end this process
        os.environ.setdefault("SDL_NO_SIGNAL_HANDLERS", "1")
        self._diagnosis = Diagnosis(self.name)
        self._begin()

    def read(self, t: int) -> list[Sample]:
        """Return where the stylus is by now, the buttons if they have changed, and a diagnosis if that has."""
        if not self._pace.due(t):
            return []
        try:
            return self._heard(t, self._window or self._opened())
        except DeviceError as error:
            self.close()
            self._pace.failed(t)
            return self._diagnosis.tell(Level.ERROR, f"{error}; it is tried again every second")

    def _opened(self) -> Window:
        from devices.keyboard.window import Window

        self._window = Window(self.name)
        return self._window

    def _heard(self, t: int, window: Window) -> list[Sample]:
        wish = window.wish()
        elapsed_ns, self._last_ns = min(t - self._last_ns, _LONGEST_NS), t
        samples: list[Sample] = []
        if (wish.dead_man, wish.jaw) != self._pressed:
            self._pressed = wish.dead_man, wish.jaw
            samples.append(button_sample(self._buttons, t, self._pressed))
        if not window.focused:
            return samples + self._diagnosis.tell(
                Level.WARN, "keys are heard only while the window of this device is in focus; click into it"
            )
        self._stylus.advance(wish, elapsed_ns * 1e-9)
        samples += self._diagnosis.tell(Level.OK, "keys are heard")
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
