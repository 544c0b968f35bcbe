"""Kind `touch`: haptic styluses of 3D Systems (Touch, Phantom) through OpenHaptics."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

from devices.haptics.servo.device import HapticDevice
from devices.haptics.servo.diagnoses import Words
from devices.openhaptics.hdapi import Code, Style, find
from devices.openhaptics.params import TouchParams
from hub.participant import Params

__all__ = ["Touch"]

_CALIBRATE = {
    Style.INKWELL: "put the stylus into the inkwell",
    Style.ENCODER_RESET: "hold the stylus in its reset position and press its button",
}


class _HdapiWords(Words):
    def error(self, code: int) -> str:
        return Code.text(code)

    def warning(self, code: int) -> str:
        cool = "; let its motors cool" if code == Code.WARM_MOTORS else ""
        return Code.text(code) + cool

    def calibration(self, style: int) -> str:
        return _CALIBRATE[Style(style)] if style in _CALIBRATE else super().calibration(style)


class Touch(HapticDevice):
    """The styluses of this machine; a Touch has two buttons, HDAPI room for four."""

    params_model: ClassVar[type[Params]] = TouchParams
    params: TouchParams
    driver = "devices.openhaptics.driver:HdapiDriver"
    words = _HdapiWords()

    def __init__(self, name: str, params: TouchParams) -> None:
        super().__init__(name, params, params.styluses, params.max_age)

    def driver_options(self, directory: Path) -> dict[str, Any]:
        """Return where the library is. Raises DeviceError if there is none."""
        library = self.params.library
        return {"library": str(find(None if library is None else directory / library))}
