"""What an arm holds, in the words of the dVRK (SAW = jhu-dvrk/sawIntuitiveResearchKit)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal

from controllers.motion.messages import Messages
from robots.dvrk.ecm import Endoscope
from robots.dvrk.instruments import Instrument
from schemas.errors import MotionError
from schemas.ros import BoolMessage, StringMessage

__all__ = ["Equipment", "endoscope_type", "tool_type"]

_GEARED = "_GEARED"
_VERSIONS = {"420006": ("..11", "12.."), "420093": ("..13", "14..")}
"""Of the instruments whose later versions are geared, both ranges (SAW share/tool/index.json)."""


def tool_type(instrument: Instrument) -> str:
    """Return `NAME:NUMBER[VERSIONS]` (SAW mtsToolList.cpp, Name), such as `LARGE_NEEDLE_DRIVER:400006[..]`;
    the name alone of what has no number.
    """
    if not instrument.number:
        return instrument.name
    name, geared = instrument.name.removesuffix(_GEARED), instrument.name.endswith(_GEARED)
    versions = _VERSIONS.get(instrument.number)
    if versions is None:
        return (
            f"{name.removesuffix(f'_{instrument.number}')}:{instrument.number}[..]{_GEARED if geared else ''}"
        )
    return f"{name.removesuffix(f'_{instrument.number}')}:{instrument.number}[{versions[geared]}]"


def endoscope_type(endoscope: Endoscope) -> str:
    """Return the name of an endoscope of the Classic with its SD camera, the one whose mass the model has
    (SAW mtsIntuitiveResearchKitEndoscopeTypes.cdg).
    """
    return f"Classic_SD_{endoscope.upper()}"


class Equipment:
    """What one arm holds for as long as the session lasts, and what carries out the commands about it, by
    their names, in `handlers`.
    """

    def __init__(self, event: Literal["tool_type", "endoscope_type"], name: str, messages: Messages) -> None:
        """Take the event that tells what the arm holds, its name there, and where to tell it."""
        self._event, self._name, self._messages = event, name, messages
        self.handlers: Mapping[str, Callable[[Any], None]] = {f"set_{event}": self._set}
        if event == "tool_type":
            self.handlers = {
                **self.handlers,
                "emulate_adapter_present": self._emulate_present,
                "emulate_tool_present": self._emulate_present,
            }

    def tell(self) -> None:
        """Tell what the arm holds."""
        self._messages.equipment(self._event, self._name)

    def _set(self, message: StringMessage) -> None:
        if message.data.partition("[")[0] != self._name.partition("[")[0]:
            raise MotionError(
                f"'{message.data}', the arm holds {self._name}; what it holds is the scenario's to say"
            )
        self.tell()

    def _emulate_present(self, message: BoolMessage) -> None:
        if not message.data:
            raise MotionError(
                f"the arm holds {self._name}, and nobody is there to take it off; what it holds is the"
                " scenario's to say"
            )
