"""Equipment of an arm, in the words of the dVRK (SAW = jhu-dvrk/sawIntuitiveResearchKit)."""

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
"""Both ranges of versions of instruments with geared later versions (SAW share/tool/index.json)."""


def tool_type(instrument: Instrument) -> str:
    """Return `NAME:NUMBER[VERSIONS]`, such as `LARGE_NEEDLE_DRIVER:400006[..]` (SAW mtsToolList.cpp, Name).

    An instrument without a number has the name alone.
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
    """Return the name of an endoscope of the Classic with the SD camera, as in the model's mass.

    Names from SAW mtsIntuitiveResearchKitEndoscopeTypes.cdg.
    """
    return f"Classic_SD_{endoscope.upper()}"


class Equipment:
    """Equipment of an arm for the whole session, and the `handlers` of related commands, by name."""

    def __init__(self, event: Literal["tool_type", "endoscope_type"], name: str, messages: Messages) -> None:
        """`event`: event for the publication of `name`; `messages`: events of the arm."""
        self._event, self._name, self._messages = event, name, messages
        self.handlers: Mapping[str, Callable[[Any], None]] = {f"set_{event}": self._set}
        if event == "tool_type":
            self.handlers = {
                **self.handlers,
                "emulate_adapter_present": self._emulate_present,
                "emulate_tool_present": self._emulate_present,
            }

    def publish(self) -> None:
        """Publish the equipment."""
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
