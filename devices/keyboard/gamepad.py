"""The first gamepad, if present: sticks and buttons in SDL's common layout for all makers."""

from __future__ import annotations

import pygame
from pygame._sdl2 import controller

from devices.keyboard.virtual_stylus import NOTHING, Wish

__all__ = ["LAYOUT", "Gamepad"]

LAYOUT = (
    "Gamepad: left stick moves, right stick points,",
    "d-pad goes up and down and rolls,",
    "left shoulder is button 0, triggers move the gripper",
)
_FULL = 32767
_DEAD_ZONE = 7849 / _FULL
"""Dead zone of a stick at rest (XINPUT_GAMEPAD_LEFT_THUMB_DEADZONE of Microsoft's XInput)."""


class Gamepad:
    """Reads the gamepad; plugging in and out is allowed at any time."""

    def __init__(self) -> None:
        """Look for a gamepad. pygame's display must be initialised: SDL needs the display's events."""
        controller.init()
        self._pad: controller.Controller | None = None
        self.find()

    def find(self) -> None:
        """Look for a gamepad again, after plugging in or out."""
        pads = (number for number in range(controller.get_count()) if controller.is_controller(number))
        first = next(pads, None)
        self._pad = None if first is None else controller.Controller(first)

    @staticmethod
    def close() -> None:
        """Stop reading gamepads."""
        controller.quit()

    def wish(self) -> Wish:
        """Return the command of sticks and buttons; no motion without a gamepad."""
        if self._pad is None or not self._pad.attached():
            return NOTHING
        close = max(0.0, self._axis_share(pygame.CONTROLLER_AXIS_TRIGGERRIGHT))
        return Wish(
            linear=(
                -self._axis_share(pygame.CONTROLLER_AXIS_LEFTY),
                -self._axis_share(pygame.CONTROLLER_AXIS_LEFTX),
                self._button_pair(pygame.CONTROLLER_BUTTON_DPAD_UP, pygame.CONTROLLER_BUTTON_DPAD_DOWN),
            ),
            angular=(
                0.0,
                0.0,
                self._button_pair(pygame.CONTROLLER_BUTTON_DPAD_RIGHT, pygame.CONTROLLER_BUTTON_DPAD_LEFT),
            ),
            turn=(
                0.0,
                self._axis_share(pygame.CONTROLLER_AXIS_RIGHTY),
                -self._axis_share(pygame.CONTROLLER_AXIS_RIGHTX),
            ),
            gripper=max(0.0, self._axis_share(pygame.CONTROLLER_AXIS_TRIGGERLEFT)) - close,
            dead_man=bool(self._pad.get_button(pygame.CONTROLLER_BUTTON_LEFTSHOULDER)),
            jaw=close > 0.0,
            pedal=bool(self._pad.get_button(pygame.CONTROLLER_BUTTON_RIGHTSHOULDER)),
            rinse=bool(self._pad.get_button(pygame.CONTROLLER_BUTTON_A)),
        )

    def _axis_share(self, axis: int) -> float:
        """Return a share from -1 to 1, growing from 0 at the edge of the dead zone."""
        assert self._pad is not None
        value = self._pad.get_axis(axis) / _FULL
        beyond = max(0.0, min(abs(value), 1.0) - _DEAD_ZONE) / (1.0 - _DEAD_ZONE)
        return beyond if value > 0.0 else -beyond

    def _button_pair(self, plus: int, minus: int) -> float:
        assert self._pad is not None
        return float(self._pad.get_button(plus)) - float(self._pad.get_button(minus))
