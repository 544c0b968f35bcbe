"""The small window for reading and showing the keys."""

from __future__ import annotations

import os

import pygame

from devices.keyboard.gamepad import LAYOUT, Gamepad
from devices.keyboard.keys import KEYS, wish_of
from devices.keyboard.virtual_stylus import Wish
from schemas.errors import DeviceError

__all__ = ["Window"]

_WIDTH, _LINE, _MARGIN, _COLUMN = 440, 24, 16, 80
_INK, _PAPER, _MARK, _FAINT = (230, 230, 230), (30, 34, 40), (90, 200, 120), (120, 124, 130)
_UNSEEN = {"offscreen", "dummy"}
"""Drivers of SDL without a screen."""


class Window:
    """The window, for a single thread, as some systems demand."""

    def __init__(self, title: str) -> None:
        """Open the window.

        Raises DeviceError without a screen, or if another device of this process has a window.
        """
        if pygame.display.get_init():
            raise DeviceError(
                "this process has a window for keys already; put the other keyboard into a host of its own"
            )
        try:
            pygame.display.init()
            self._check_seen()
            pygame.font.init()
            self._surface = pygame.display.set_mode(
                (_WIDTH, 2 * _MARGIN + _LINE * (len(KEYS) + 3 + len(LAYOUT)))
            )
            pygame.display.set_caption(f"Trocar: {title}")
            self._font = pygame.font.Font(None, _LINE)
            self._gamepad = Gamepad()
        except pygame.error as error:
            pygame.display.quit()
            raise DeviceError(
                f"there is no screen to open a window on ({error}); log in to a desktop on this machine"
            ) from error
        except DeviceError:
            pygame.display.quit()
            raise
        self.focused = pygame.key.get_focused()
        """Whether the window gets the keys."""
        self._pressed: set[str] = set()
        self._draw()

    @staticmethod
    def _check_seen() -> None:
        driver = pygame.display.get_driver()
        if driver in _UNSEEN and os.environ.get("SDL_VIDEODRIVER") != driver:
            raise DeviceError("there is no screen to open a window on; log in to a desktop on this machine")

    def wish(self) -> Wish:
        """Handle the events since the last call, and return the command of keys and gamepad."""
        before = self.focused, set(self._pressed)
        for event in pygame.event.get():
            self._handle(event)
        if before != (self.focused, self._pressed):
            self._draw()
        return wish_of(self._pressed) + self._gamepad.wish() if self.focused else Wish()

    def _handle(self, event: pygame.Event) -> None:
        """Handle an event; a request to close the window is ignored, as the session ends the device."""
        if event.type == pygame.KEYDOWN:
            self._pressed.add(pygame.key.name(event.key))
        elif event.type == pygame.KEYUP:
            self._pressed.discard(pygame.key.name(event.key))
        elif event.type in (pygame.WINDOWFOCUSGAINED, pygame.WINDOWFOCUSLOST):
            self.focused = event.type == pygame.WINDOWFOCUSGAINED
            self._pressed.clear()  # a release in another window does not arrive here
        elif event.type in (pygame.CONTROLLERDEVICEADDED, pygame.CONTROLLERDEVICEREMOVED):
            self._gamepad.find()

    def _draw(self) -> None:
        self._surface.fill(_PAPER)
        self._write(
            0,
            0,
            "Keys are read" if self.focused else "Keys are not read: click into this window",
            _INK if self.focused else _MARK,
        )
        for row, (key, (meaning, _)) in enumerate(KEYS.items(), start=2):
            colour = _MARK if key in self._pressed else _INK
            self._write(row, 0, key, colour)
            self._write(row, _COLUMN, meaning, colour)
        for row, line in enumerate(LAYOUT, start=len(KEYS) + 3):
            self._write(row, 0, line, _FAINT)
        pygame.display.flip()

    def _write(self, row: int, column: int, text: str, colour: tuple[int, int, int]) -> None:
        self._surface.blit(self._font.render(text, True, colour), (_MARGIN + column, _MARGIN + row * _LINE))

    def close(self) -> None:
        """Close the window."""
        self._gamepad.close()
        pygame.font.quit()
        pygame.display.quit()
