"""A stepped participant, driven by a test."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from hub.participant import BondPlan, Inputs, Setup, Stepped, Value
from hub.transport.port_codec import codec_of
from schemas.errors import SessionError, did_you_mean
from schemas.message import Message
from schemas.ports import Port, bond_ports

__all__ = ["Driver", "start_value"]


class Driver:
    """A configured participant: a test sets inputs, sends messages, makes steps and reads outputs.

        driver = Driver(Teleoperation("teleop", TeleoperationParams()), inputs={"scale": [0.2]})
        driver.set("master", [0.3, -0.1, 0.2, 0.0, 0.0, 0.0, 1.0])     # kept until set again
        driver.send("buttons", Joy(buttons=[1]))                       # arrives in the next step
        driver.step()["servo_jp"]                                      # (6,), rad and m
        driver.stale("master")                                         # the device of this port is silent
        driver.step(100)
        driver.sent.get("warning", ())                                 # all messages of these 100 steps

    No other participant, no clock and no hub are involved; `check_engine` checks the contract.
    """

    def __init__(
        self,
        participant: Stepped,
        *,
        period_ns: int = 1_000_000,
        inputs: Mapping[str, ArrayLike | Message] | None = None,
        bonds: Mapping[str, BondPlan] | None = None,
        directory: Path | None = None,
    ) -> None:
        """Configure a participant.

        Args:
            participant: A new instance, not configured.
            period_ns: Duration of a step, in nanoseconds.
            inputs: Values of signals with a source; signals without a source begin at the start value.
            bonds: The bonds to connect, by name; default: none.
            directory: Where relative paths start; default: the working directory.
        """
        plans = bonds or {}
        self.participant = participant
        self.time_ns = 0
        """Simulated time, in nanoseconds."""
        self._period_ns = period_ns
        sides = {side.name: side for side in participant.bonds}
        ports = [*participant.ports, *(port for name in plans for port in bond_ports(sides[name]))]
        self._inputs = {port.name: port for port in ports if port.causality == "input"}
        self.values = {
            port.name: start_value(port) for port in self._inputs.values() if port.variability == "signal"
        }
        """Value of each input signal, by port; a test may write to these arrays between two steps."""
        for port, value in (inputs or {}).items():
            self.set(port, value)
        self._events: dict[str, tuple[Message, ...]] = {}
        self._stale: set[str] = set()
        self._view = Inputs(self.values, events=self._events, stale=self._stale)
        setup = Setup(period_ns, directory or Path.cwd(), plans, frozenset(inputs or ()))
        self.outputs: dict[str, Value] = dict(participant.configure(setup))
        """The newest value of each output, by port."""
        self.sent: dict[str, tuple[Message, ...]] = {}
        """Messages on event outputs since the last call of `step` began, by port."""

    def set(self, port: str, value: ArrayLike | Message) -> None:
        """Set a signal: a vector, or a message where the type of the port has no vector form.

        Raises:
            SessionError: There is no such input signal.
            MessageError: The value does not fit the port.
        """
        if port not in self.values:
            raise SessionError(f"no input signal '{port}'.{did_you_mean(port, self.values)}")
        vector = codec_of(self._inputs[port]).vector
        if vector is not None:
            value = vector.check_vector(np.atleast_1d(np.array(value, np.float64)))
        self.values[port] = value

    def send(self, port: str, *messages: Message) -> None:
        """Send messages to an event port; the messages arrive in the next step, after messages sent before.

        Raises:
            SessionError: There is no such event port, or the type differs.
        """
        events = self._inputs.keys() - self.values.keys()
        if port not in events:
            raise SessionError(f"no input port of events '{port}'.{did_you_mean(port, events)}")
        for message in messages:
            if message.ros_type != self._inputs[port].type:
                raise SessionError(
                    f"'{port}' accepts {self._inputs[port].type}, not {message.ros_type}: send such a message"
                )
        if messages:
            self._events[port] = (*self._events.get(port, ()), *messages)

    def stale(self, *ports: str) -> None:
        """Let the devices of these inputs be silent from now on, and of no others.

        Raises:
            SessionError: There is no such input.
        """
        for port in ports:
            if port not in self._inputs:
                raise SessionError(f"no input port '{port}'.{did_you_mean(port, self._inputs)}")
        self._stale.clear()
        self._stale.update(ports)

    def step(self, count: int = 1) -> dict[str, Value]:
        """Step `count` times; return the newest value of each output, by port."""
        self.sent = {}
        for _ in range(count):
            outputs = self.participant.step(self.time_ns, self._period_ns, self._view)
            self.time_ns += self._period_ns
            self._events.clear()
            self.outputs = {**self.outputs, **outputs}
            for port, value in outputs.items():
                if isinstance(value, tuple) and value:
                    self.sent[port] = (*self.sent.get(port, ()), *value)
        return self.outputs

    def __getitem__(self, port: str) -> Any:
        """Return the newest value of an output."""
        if port not in self.outputs:
            raise SessionError(f"no output '{port}'.{did_you_mean(port, self.outputs)}")
        return self.outputs[port]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.participant.close()


def start_value(port: Port) -> Any:
    """Return the value of an input signal without a source: a vector, or None for a type without one."""
    vector = codec_of(port).vector
    if vector is None:
        return None
    return vector.neutral.copy() if port.start is None else np.array(port.start, np.float64)
