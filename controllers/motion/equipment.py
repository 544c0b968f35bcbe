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
    """Return `NAME:NUMBER[VERSIONS]`, such as `LARGE_NEEDLE_DRIVER:400006[..]` (SAW mtsToolList.cpp, Name).

    An instrument without a number has its name alone.
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
    """Return the name of an endoscope of the Classic with its SD camera, whose mass the model has.

    Names are those of SAW mtsIntuitiveResearchKitEndoscopeTypes.cdg.
    """
    return f"Classic_SD_{endoscope.upper()}"


class Equipment:
    """What one arm holds while the session lasts, and the `handlers` of commands about it, by name."""

    def __init__(self, event: Literal["tool_type", "endoscope_type"], name: str, messages: Messages) -> None:
        """Take the event that publishes what the arm holds, the name to publish, and the arm's events."""
        self._event, self._name, self._messages = event, name, messages
        self.handlers: Mapping[str, Callable[[Any], None]] = {f"set_{event}": self._set}
        if event == "tool_type":
            self.handlers = {
                **self.handlers,
                "emulate_adapter_present": self._emulate_present,
                "emulate_tool_present": self._emulate_present,
            }

    def publish(self) -> None:
        """Publish what the arm holds."""
        self._messages.equipment(self._event, self._name)

    def _set(self, message: StringMessage) -> None:
        if message.data.partition("[")[0] != self._name.partition("[")[0]:
            raise MotionError(
                f"'{message.data}', the arm holds {self._name}; the scenario states what it holds"
            )
        self.publish()

    def _emulate_present(self, message: BoolMessage) -> None:
        if not message.data:
            raise MotionError(
                f"the arm holds {self._name}, which cannot be removed while the session runs; the scenario"
                " states what it holds"
            )
