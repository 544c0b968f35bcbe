"""Equipment of an arm, in the words of the dVRK (SAW = jhu-dvrk/sawIntuitiveResearchKit)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from controllers.motion.messages import Messages
from robots.dvrk.ecm import Endoscope
from schemas.errors import MotionError
from schemas.ros import BoolMessage, StringMessage

if TYPE_CHECKING:
    from controllers.motion.exchange import Exchange

__all__ = ["Equipment", "endoscope_type"]


def endoscope_type(endoscope: Endoscope) -> str:
    """Return the name of an endoscope of the Classic with the SD camera, as in the model's mass.

    Names from SAW mtsIntuitiveResearchKitEndoscopeTypes.cdg.
    """
    return f"Classic_SD_{endoscope.upper()}"


class Equipment:
    """What an arm holds, and the `handlers` of related commands, by name."""

    def __init__(
        self,
        event: Literal["tool_type", "endoscope_type"],
        names: Sequence[str],
        messages: Messages,
        exchange: Exchange | None = None,
    ) -> None:
        """Know the equipment.

        Args:
            event: event for the publication of the name.
            names: what the arm may hold, as mounted first.
            messages: events of the arm.
            exchange: gives the arm other instruments, if there are any.
        """
        self._event, self._names, self._messages, self._exchange = event, names, messages, exchange
        self.handlers: Mapping[str, Callable[[Any], None]] = {f"set_{event}": self._set}
        if event == "tool_type":
            self.handlers = {
                **self.handlers,
                "emulate_adapter_present": self._emulate_present,
                "emulate_tool_present": self._emulate_present,
            }

    @property
    def _name(self) -> str:
        return self._names[0 if self._exchange is None else self._exchange.state.held]

    def publish(self) -> None:
        """Publish the equipment."""
        self._messages.equipment(self._event, self._name)

    def _set(self, message: StringMessage) -> None:
        known = [name.partition("[")[0] for name in self._names]
        if (asked := message.data.partition("[")[0]) not in known:
            what = (
                f"it may hold {', '.join(self._names)}" if len(known) > 1 else f"the arm holds {self._name}"
            )
            raise MotionError(f"'{message.data}', {what}; the scenario states what it may hold")
        if self._exchange is not None and self._names[known.index(asked)] != self._name:
            self._exchange.begin(known.index(asked))
        else:
            self.publish()

    def _emulate_present(self, message: BoolMessage) -> None:
        if not message.data:
            raise MotionError(
                f"the arm holds {self._name}, which cannot be removed while the session runs; the scenario"
                " states what it holds, and `spares` what it may get in exchange"
            )
