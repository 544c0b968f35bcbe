"""Inputs of a leading page, from the page's server to the device, in the same process, and the answer."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from time import monotonic_ns

from devices.keyboard.virtual_stylus import Wish
from devices.vendor_axes import Quaternion, Vector3

__all__ = ["Obedience", "PageHand", "PageInput", "hand_of"]


@dataclass(frozen=True, slots=True)
class PageInput:
    """Commands of keys, sticks and pointer of a page."""

    wish: Wish
    drag: Vector3 = (0.0, 0.0, 0.0)
    """Way of the pointer since the page leads, m: ahead, left, up; the next message makes up for a lost
    message.
    """
    tracked: tuple[Vector3, Quaternion] | None = None
    """Pose of the head or hand by a headset, in the base frame, in place of shares and way. The axes of
    head and hand, too, are x ahead, y left, z up.
    """
    away: bool = False
    """Whether the page is no longer in front: the last input before a silence."""


class Obedience(StrEnum):
    """How a device follows its leading page."""

    UNLED = "unled"
    """No page leads."""
    OPEN = "open"
    """The dead-man is open."""
    MOVES = "moves"
    """The dead-man is held."""
    AWAY = "away"
    """The page is not in front."""
    SILENT = "silent"
    """The page is silent; the dead-man may go on, if the silence is short."""
    SPENT = "spent"
    """The dead-man was held through a loss, and has to be pressed anew."""


class PageHand:
    """The newest input of the leading page, written by the page's server, read by the device."""

    def __init__(self, clock: Callable[[], int] = monotonic_ns) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._newest: tuple[PageInput, int] | None = None
        self._instrument: str | None = None
        self._leads = 0
        self.served = False
        """Whether a server of pages is in this process."""
        self.obedience = Obedience.UNLED
        """Written by the device, read by the page's server."""

    def give(self, asked: PageInput) -> None:
        """Replace the input."""
        with self._lock:
            self._newest = asked, self._clock()

    def ask_for(self, instrument: str) -> None:
        """Ask for an instrument in exchange, in the dVRK's words."""
        with self._lock:
            self._instrument = instrument

    def take_instrument(self) -> str | None:
        """Return the instrument asked for since the last call; None without one."""
        with self._lock:
            asked, self._instrument = self._instrument, None
            return asked

    def release(self) -> None:
        """Forget the input: no page leads any more."""
        with self._lock:
            self._newest = self._instrument = None
            self._leads += 1

    def newest(self) -> tuple[PageInput, int, int] | None:
        """Return the input, its age (ns) and the number of the lead; None if no page leads."""
        with self._lock:
            if self._newest is None:
                return None
            asked, at_ns = self._newest
            return asked, self._clock() - at_ns, self._leads


_hands: dict[str, PageHand] = {}


def hand_of(device: str) -> PageHand:
    """Return the hand of a device of this process, by the device's name."""
    return _hands.setdefault(device, PageHand())
