"""Keyboard or gamepad in place of a stylus or a headset (kind `keyboard`).

pygame-ce gives window, keys and gamepads on every desktop. The window is opened in the reading thread.
"""

from __future__ import annotations

import os
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from devices.diagnosis import Diagnosis, Level
from devices.keyboard.virtual_hand import VirtualHand, VirtualHandParams
from hub.participant import Params, Sample
from schemas.errors import DeviceError, MissingExtraError

if TYPE_CHECKING:
    from devices.keyboard.window import Window

__all__ = ["Keyboard", "KeyboardParams"]


class KeyboardParams(VirtualHandParams):
    """Frame moved by the keys, and speeds."""


class Keyboard(VirtualHand):
    """Publishes `pose`, `twist`, `buttons`, `gripper` and `diagnostics` like a stylus.

    While the window is not in focus, only the diagnostics. The moved frame starts at the origin of
    `<participant>_base`, pointing level away from the user; devices.keyboard.keys has the keys.
    """

    params_model: ClassVar[type[Params]] = KeyboardParams
    params: KeyboardParams

    longest_pause_ns = 100_000_000

    def __init__(self, name: str, params: KeyboardParams) -> None:
        super().__init__(name, params)
        self._window: Window | None = None

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
        """Return the present pose and twist, and changed buttons and diagnoses."""
        if not self._timer.due(t):
            return []
        try:
            return self._samples(t, self._window or self._open_window())
        except DeviceError as error:
            self.close()
            self._timer.failed(t)
            return self._diagnosis.report(Level.ERROR, f"{error}; the next try is in a second")

    def _open_window(self) -> Window:
        from devices.keyboard.window import Window

        self._window = Window(self.name)
        return self._window

    def _samples(self, t: int, window: Window) -> list[Sample]:
        wish = window.wish()
        seconds = self._elapse(t)
        samples = self._press(t, wish)
        if not window.focused:
            return samples + self._diagnosis.report(
                Level.WARN, "keys are read only while the window of this device is in focus; click into it"
            )
        self._stylus.advance(wish, seconds)
        return samples + self._diagnosis.report(Level.OK, "keys are read") + self._motion(t)

    def close(self) -> None:
        """Close the window."""
        if self._window is not None:
            self._window.close()
        self._window = None
