"""Reading of an input from the cell of the source, for devices in simulated time too."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from hub.participant import Value
from hub.transport.cells import INITIAL, Cell
from hub.transport.port_codec import PortCodec
from schemas.message import Message
from schemas.ports import Port

__all__ = ["DeviceInputs", "Queue", "Reader", "as_messages"]

Messages = Callable[[Any, int], tuple[Message, ...]]
"""Makes messages of a value and the time of validity (ns)."""


@dataclass(slots=True)
class Reader:
    """An input port, the cell that feeds it, and the way of reading."""

    port: str
    cell: Cell
    fresh: bool
    linear: bool
    messages: Messages | None
    """Function from a value of the source to messages, for an event port; None for a signal."""
    stride_s: float
    seen: int = INITIAL

    def events(self, step: int, step_ns: int) -> list[tuple[int, Message]]:
        """Return the new messages in `step` on an event port, oldest first, with times of validity (ns)."""
        if self.messages is None:
            raise ValueError(f"'{self.port}' is a signal")
        cell, tag = self.cell, self.cell.tag(step, fresh=self.fresh)
        arrived: list[tuple[int, Message]] = []
        while self.seen < tag:
            self.seen = cell.after(self.seen)
            time_ns = cell.valid_from(self.seen) * step_ns
            arrived.extend((time_ns, message) for message in self.messages(cell.get(self.seen), time_ns))
        return arrived


@dataclass(slots=True)
class Queue:
    """An event port written by a neighbour in this process."""

    port: str
    arrived: list[Message] = field(default_factory=list[Message])
    """Messages since the last read."""


class DeviceInputs:
    """The connected inputs of a device in simulated time.

    At a communication point these are the values computed by all participants until then.
    """

    def __init__(self, readers: Sequence[Reader], step_ns: int) -> None:
        self._events = [reader for reader in readers if reader.messages is not None]
        self._signals = [reader for reader in readers if reader.messages is None]
        self._newest = {reader.port: INITIAL - 1 for reader in self._signals}
        self._step_ns = step_ns

    def due(self, step: int) -> Iterator[tuple[str, int, Value]]:
        """Yield port, time of validity (ns) and value of every event, and of each signal with a new value."""
        for reader in self._signals:
            tag = reader.cell.tag(step, fresh=False)
            if tag > self._newest[reader.port]:
                self._newest[reader.port] = tag
                yield reader.port, reader.cell.valid_from(tag) * self._step_ns, reader.cell.get(tag)
        for reader in self._events:
            for time_ns, message in reader.events(step, self._step_ns):
                yield reader.port, time_ns, message


def as_messages(source: Port, target: Port) -> Messages | None:
    """Return the function making messages of an event port `target` of a value of `source`.

    None if the target is a signal.
    """
    if target.variability == "signal":
        return None
    if source.variability == "event":
        return lambda value, _: value
    codec = PortCodec(source.filled_from(target)).vector
    if codec is None:
        return lambda value, _: (value,)
    return lambda value, time_ns: (codec.to_message(value, time_ns),)
