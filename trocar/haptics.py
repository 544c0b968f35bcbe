"""Haptic devices of your own: a driver of some forty lines, held at 1 kHz by a process with all limits.

`Driver` is the interface to a vendor's library, `StylusSpec`, `Opened` or `Unavailable`, `Reading` and
`DriverError` are what passes; `ServoPhase` is the condition of a stylus. `HapticDevice` is the base of the
kind, `StylusParams` that of the parameters of one stylus, `Words` puts a driver's numbers into words.
`docs/how-to/own-haptic-device.md` makes one.

Names are imported when they are first used: a driver runs in a process that should hold little.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from devices.haptics.servo.device import HapticDevice
    from devices.haptics.servo.diagnoses import Words
    from devices.haptics.servo.driver import (
        Driver,
        DriverError,
        Opened,
        Reading,
        StylusSpec,
        Unavailable,
    )
    from devices.haptics.servo.params import ServoStylusParams as StylusParams
    from devices.haptics.servo.phase import ServoPhase

__all__ = [
    "Driver",
    "DriverError",
    "HapticDevice",
    "Opened",
    "Reading",
    "ServoPhase",
    "StylusParams",
    "StylusSpec",
    "Unavailable",
    "Words",
]

_ORIGINS = {
    "HapticDevice": ("device", "HapticDevice"),
    "ServoPhase": ("phase", "ServoPhase"),
    "StylusParams": ("params", "ServoStylusParams"),
    "Words": ("diagnoses", "Words"),
}


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used (PEP 562)."""
    if name not in __all__:
        raise AttributeError(
            f"module 'trocar.haptics' has no public name '{name}'; it has {', '.join(__all__)}"
        )
    module, origin = _ORIGINS.get(name, ("driver", name))
    value = globals()[name] = getattr(import_module(f"devices.haptics.servo.{module}"), origin)
    return value
