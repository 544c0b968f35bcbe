"""What a stepped participant sees of its inputs in one step."""

from __future__ import annotations

from collections.abc import KeysView
from typing import Any, cast

from schemas.errors import SessionError, did_you_mean
from schemas.message import Message
from schemas.vectors import Vector

__all__ = ["Inputs"]


class Inputs:
    """The inputs of one participant in one step.

        force = inputs["force"]               # (size,), at the start of the step
        later = inputs.at("force", 0.5e-3)    # (size,), 0.5 ms into the step

    `inputs["port"]` is the value at the start of the step; `at` follows it inside the step where the
    connection is linear: between the source's last two values while it is ahead, beyond them while it is not.
    The arrays belong to their producer: read, do not write.
    """

    __slots__ = ("_events", "_rates", "_stale", "_values")

    def __init__(
        self,
        values: dict[str, Any],
        *,
        rates: dict[str, Vector] | None = None,
        events: dict[str, tuple[Message, ...]] | None = None,
        stale: set[str] | None = None,
    ) -> None:
        """Read from these containers, which the host keeps and writes to before each step.

        Args:
            values: The value of every signal input; at first the one at time 0.
            rates: The slope (1/s) of every input whose connection is linear.
            events: The messages of every event port that has any in this step.
            stale: The inputs whose device is silent.
        """
        self._values = values
        self._rates = {} if rates is None else rates
        self._events = {} if events is None else events
        self._stale = set[str]() if stale is None else stale

    def __getitem__(self, port: str) -> Vector:
        """Return the vector at the start of the step."""
        try:
            return self._values[port]
        except KeyError:
            raise SessionError(f"no input port '{port}'.{did_you_mean(port, self._values)}") from None

    def message(self, port: str) -> Message | None:
        """Return the newest message of a signal that has no vector form; None before the first."""
        return cast("Message | None", self._values[port])

    def at(self, port: str, tau: float) -> Vector:
        """Return the vector `tau` seconds after the start of the step, held or extrapolated.

        The connection says which of the two: see `rate`.
        """
        rate = self._rates.get(port)
        return self[port] if rate is None else self._values[port] + tau * rate

    def rate(self, port: str) -> Vector | None:
        """Return the slope (1/s) with which the connection extrapolates; None if it holds."""
        return self._rates.get(port)

    def events(self, port: str) -> tuple[Message, ...]:
        """Return the messages that arrived on an event port since the last step, oldest first."""
        return self._events.get(port, ())

    @property
    def event_ports(self) -> KeysView[str]:
        """The event ports that have a message in this step; a step must not depend on their order."""
        return self._events.keys()

    @property
    def quiet(self) -> bool:
        """Whether no event port has a message in this step."""
        return not self._events

    def stale(self, port: str) -> bool:
        """Return whether the device of this port is silent for longer than the port allows.

        Also true before its first sample.
        """
        return port in self._stale
