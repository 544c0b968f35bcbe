"""The inputs of a stepped participant in a step."""

from __future__ import annotations

from collections.abc import KeysView
from typing import Any, cast

from schemas.errors import SessionError, did_you_mean
from schemas.message import Message
from schemas.vectors import Vector

__all__ = ["Inputs"]


class Inputs:
    """The inputs of a participant in a step.

        force = inputs["force"]               # (size,), at the start of the step
        later = inputs.at("force", 0.5e-3)    # (size,), 0.5 ms into the step

    `inputs["port"]` is the value at the start of the step; `at` gives a later value inside the step where the
    connection is linear: between the source's last two values while the source is ahead, otherwise beyond the
    last value. The arrays belong to their producer: read, do not write.
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
        """Read from these containers, written by the host before each step.

        Args:
            values: The value of every signal input; at first the value at time 0.
            rates: The slope (1/s) of every input with a linear connection.
            events: The messages of every event port with a message in this step.
            stale: The inputs from a silent device.
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

    @property
    def containers(self) -> tuple[dict[str, Any], dict[str, Vector]]:
        """Values by port and slopes (1/s) by port, for compiled readers: read, do not write."""
        return self._values, self._rates

    def number(self, port: str, default: float) -> float:
        """Return the number of a port; `default` if the plan, of an older version, has no such port."""
        value = self._values.get(port)
        return default if value is None else float(value[0])

    def message(self, port: str) -> Message | None:
        """Return the newest message of a signal without a vector form; None before the first."""
        return cast("Message | None", self._values[port])

    def at(self, port: str, tau: float) -> Vector:
        """Return the vector `tau` seconds after the start of the step, held or extrapolated.

        The connection decides: see `rate`.
        """
        rate = self._rates.get(port)
        return self[port] if rate is None else self._values[port] + tau * rate

    def rate(self, port: str) -> Vector | None:
        """Return the slope (1/s) of an extrapolating connection; None if the connection holds."""
        return self._rates.get(port)

    def events(self, port: str) -> tuple[Message, ...]:
        """Return the messages received on an event port since the last step, oldest first."""
        return self._events.get(port, ())

    @property
    def event_ports(self) -> KeysView[str]:
        """The event ports with a message in this step; a step must not depend on their order."""
        return self._events.keys()

    @property
    def quiet(self) -> bool:
        """Whether no event port has a message in this step."""
        return not self._events

    def stale(self, port: str) -> bool:
        """Return whether the device of this port is silent for longer than the port allows.

        Also true before the first sample.
        """
        return port in self._stale
