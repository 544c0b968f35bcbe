"""Both hands of a person at a page, in place of a pair of styluses (kind `browser-pair`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

from devices.browser.device import Browser, BrowserParams
from hub.participant import Device, Params, Sample
from schemas.ports import Port

__all__ = ["BrowserPair"]

_HANDS = ("right", "left")


class BrowserPair(Device):
    """Has the ports of `browser` under `right/` and `left/`, as a pair of styluses has.

    A page leads each hand by itself, as `<participant>/right` and `<participant>/left`.
    """

    params_model: ClassVar[type[Params]] = BrowserParams
    params: BrowserParams

    def __init__(self, name: str, params: BrowserParams) -> None:
        super().__init__(name, params)
        self._hands: Mapping[str, Browser] = {
            hand: Browser(led, params) for hand, led in zip(_HANDS, self.led(name), strict=True)
        }

    @staticmethod
    def led(name: str) -> tuple[str, ...]:
        """Return the names by which pages lead the hands of a participant."""
        return tuple(f"{name}/{hand}" for hand in _HANDS)

    @property
    def ports(self) -> tuple[Port, ...]:
        """Those of both hands."""
        return tuple(
            port.model_copy(update={"name": f"{hand}/{port.name}"})
            for hand, device in self._hands.items()
            for port in device.ports
        )

    def open(self, directory: Path) -> None:
        """Wait for a page."""
        for device in self._hands.values():
            device.open(directory)

    def read(self, t: int) -> list[Sample]:
        """Return the new samples of both hands."""
        return [
            replace(sample, port=f"{hand}/{sample.port}")
            for hand, device in self._hands.items()
            for sample in device.read(t)
        ]

    def close(self) -> None:
        """Obey no page any more."""
        for device in self._hands.values():
            device.close()
