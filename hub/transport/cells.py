"""Cells: the last values of an output port, by the same rules inside a process and between processes.

A value carries the step of its computation (the *tag*; -1 for the value at time 0). Readers ask for a tag,
never for "the newest": the result does not depend on timing or on the placement of participants.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from schemas.errors import SessionError

__all__ = ["INITIAL", "Cell", "RemoteCell"]

INITIAL = -1


class Receiver(Protocol):
    """Receives the values of a remote cell."""

    def receive(self) -> tuple[int, Any]:
        """Wait for the next valid value; return tag and value."""
        ...

    def poll(self) -> tuple[int, Any] | None:
        """Return the next valid value if any has arrived."""
        ...


class Cell:
    """The last values of an output port of a participant in this process.

    Args:
        period: The source's period, in steps.
        stride: The distance of two values, in steps.
        depth: The number of values readers may look back.
    """

    def __init__(self, period: int, stride: int, depth: int) -> None:
        self._period = period
        self.stride = stride
        self._depth = depth
        self._values: dict[int, Any] = {}

    def put(self, tag: int, value: Any) -> None:
        """Store the value computed in step `tag`.

        An array is copied if readers look back: the owner may reuse the array.
        """
        if self._depth == 1:
            self._values = {tag: value}
            return
        self._values[tag] = value.copy() if isinstance(value, np.ndarray) else value
        if len(self._values) > self._depth:
            del self._values[next(iter(self._values))]

    def get(self, tag: int) -> Any:
        """Return the value computed in step `tag`."""
        return self._values[tag]

    def tag(self, step: int, *, fresh: bool) -> int:
        """Return the tag for a reader in `step`.

        This is the tag of the newest step begun (`fresh`), or of the newest step completed by then.
        """
        count = (step + self._period if fresh else step) // self.stride
        return count * self.stride - self._period if count else INITIAL

    def valid_from(self, tag: int) -> int:
        """Return the communication point at which the value of `tag` holds: the end of the step."""
        return tag + self._period if tag > INITIAL else 0

    def before(self, tag: int) -> int:
        """Return the tag of the value before `tag`."""
        return max(tag - self.stride, INITIAL)

    def after(self, tag: int) -> int:
        """Return the tag of the value after `tag`."""
        return (tag if tag > INITIAL else -self._period) + self.stride


class RemoteCell(Cell):
    """The values of an output port of a participant in another process; `get` waits for arrival."""

    def __init__(self, period: int, stride: int, depth: int, receiver: Receiver) -> None:
        super().__init__(period, stride, depth)
        self._receiver = receiver
        self._newest = INITIAL - 1
        self.waiting = False
        """Whether `get` waits for a value now."""

    def has_initial_value(self) -> bool:
        """Return whether the value at time 0 has arrived; to be called before any `get`."""
        while INITIAL not in self._values and (arrived := self._receiver.poll()) is not None:
            self._keep(*arrived)
        return INITIAL in self._values

    def _keep(self, tag: int, value: Any) -> None:
        # the value at time 0 is repeated until every host has it; any other old value is a duplicate
        if tag > self._newest:
            self._newest = tag
            self.put(tag, value)

    def take_until(self, tag: int) -> None:
        """Receive the values arrived up to step `tag`, the next value read.

        A sender waits while too many values are not received.
        """
        while self._newest < tag and (arrived := self._receiver.poll()) is not None:
            self._keep(*arrived)

    def get(self, tag: int) -> Any:
        """Wait for the value computed in step `tag`, and return the value."""
        while tag not in self._values:
            if self._newest > tag:
                raise SessionError(
                    f"the value of step {tag} was lost: that of step {self._newest} arrived instead"
                )
            self.waiting = True
            self._keep(*self._receiver.receive())
            self.waiting = False
        return self._values[tag]
