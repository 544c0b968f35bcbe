"""What the console says in events in the present step."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from schemas.message import Message

__all__ = ["Voice"]


class Voice:
    """The event outputs of the present step, by port."""

    def __init__(self, ports: Iterable[str]) -> None:
        """Take the names of all event outputs."""
        self.outputs: dict[str, Any] = dict.fromkeys(ports, ())
        self._spoken: set[str] = set()

    def begin(self) -> None:
        """Forget what was said."""
        for port in self._spoken:
            self.outputs[port] = ()
        self._spoken.clear()

    def say(self, port: str, message: Message) -> None:
        """Say `message` on `port`."""
        self.outputs[port] += (message,)
        self._spoken.add(port)
