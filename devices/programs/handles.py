"""Handles of commands that take time: wait for the end, or look whether it has come.

As of crtk_python_client (utils.py, wait_move_handle): a command returns at once, and its handle waits until
the arm is not busy in an operating state newer than the command. Beyond that client, a refusal or a fault
raises MotionError.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from time import monotonic

from devices.programs.connection import Connection
from schemas.codec import decode
from schemas.crtk import OperatingState
from schemas.errors import ConnectError, MotionError
from schemas.ros import BoolMessage, StringMessage

__all__ = ["ArmEvents", "Handle", "Move", "StateChange"]

_Event = OperatingState | bool | str
"""Operating state, whether a goal was reached, or text of an error or warning."""
_KEPT = 1000
"""Events kept for handles that look rarely."""
_GRACE_S = 0.3
"""Wait for further events of the same step: each topic is a stream of its own."""
_REFUSED = re.compile(r"[^:]+: (\S+) refused: (.*)", re.DOTALL)
_PROGRAM = re.compile(r"(?:^|from |by )(/\w+)")
"""Name of the refused program in a refusal by the gateway; a refusal by the arm has none."""


class ArmEvents:
    """Events of an arm in the order of arrival: operating states, reached goals, errors and warnings."""

    def __init__(self, connection: Connection, arm: str) -> None:
        self.arm, self.connection = arm, connection
        self.count = 0
        """Number of events so far."""
        self._kept: deque[_Event] = deque(maxlen=_KEPT)
        self._refused: dict[str, str] = {}
        self._state: OperatingState | None = None
        # not latched: a refusal from before this program is none of its own
        connection.listen(f"/{arm}/error", self._receive_text)
        connection.listen(f"/{arm}/warning", self._receive_text)
        connection.listen(f"/{arm}/goal_reached", lambda p: self._add(decode(BoolMessage, p).data))
        connection.listen(f"/{arm}/operating_state", self._receive_state, latched=True)
        if not connection.wait_for(lambda: self._state is not None, connection.start_s):
            raise ConnectError(
                f"{arm} has no operating state within {connection.start_s:g} s: {connection.label} has not"
                " started, or has no controller of kind motion that is connected to its gateway"
            )

    @property
    def state(self) -> OperatingState:
        """The newest operating state."""
        return OperatingState() if self._state is None else self._state

    def since(self, number: int) -> list[_Event]:
        """Return the events after the first `number` events."""
        kept, count = list(self._kept), self.count
        return kept[max(len(kept) - (count - number), 0) :] if count > number else []

    def take_refusal(self, command: str) -> str:
        """Return the sentence of the last refusal of a streamed command, once; empty: none."""
        return self._refused.pop(command, "")

    def refusal(self, text: str) -> tuple[str, str] | None:
        """Return command and sentence if `text` refuses a command of this program."""
        if (match := _REFUSED.fullmatch(text)) is None:
            return None
        program = _PROGRAM.search(match[2])
        if program is not None and program[1] != self.connection.node:
            return None
        return match[1], text

    def _receive_text(self, payload: bytes) -> None:
        text = decode(StringMessage, payload).data
        if (refused := self.refusal(text)) is not None:
            self._refused[refused[0]] = refused[1]
        self._add(text)

    def _receive_state(self, payload: bytes) -> None:
        self._state = decode(OperatingState, payload)
        self._add(self._state)

    def _add(self, event: _Event) -> None:
        self._kept.append(event)
        self.count += 1


class Handle(ABC):
    """A command under way."""

    def __init__(self, events: ArmEvents, command: str) -> None:
        """Begin before `command` (`move_jp`, `jaw/move_jp`, `home`) is sent."""
        self._events, self._command = events, command
        self._seen = events.count
        self._failure = ""
        self._ended_at: float | None = None
        """When the end was first seen, by the monotonic clock, s."""

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait until the command has been executed.

        Raises MotionError, with the arm's own sentence, if the arm refuses the command, does not finish, or
        is not done after `timeout_s`; SessionError if the session ends meanwhile.
        """
        if not self._events.connection.wait_for(lambda: not self.is_busy(), timeout_s):
            raise MotionError(
                f"{self._events.arm}: {self._command} is not finished after {timeout_s:g} s; it goes on"
            )
        if self._failure:
            raise MotionError(self._failure)

    def is_busy(self) -> bool:
        """Return whether the command is still being executed."""
        events = self._events.since(self._seen)
        self._seen += len(events)
        for event in events:
            if isinstance(event, str) and "FAULT: " in event:
                self._failure = self._failure or event
            self._advance(event)
        return not (self._failure or self._is_finished())

    @abstractmethod
    def _advance(self, event: _Event) -> None:
        """Note an event."""

    @abstractmethod
    def _is_finished(self) -> bool:
        """Return whether the command has ended without a known failure."""

    def _graced(self) -> bool:
        """Return whether events of the same step as the end would have arrived."""
        return self._ended_at is not None and monotonic() - self._ended_at > _GRACE_S


class Move(Handle):
    """A move of an arm or a jaw."""

    def __init__(self, events: ArmEvents, command: str) -> None:
        super().__init__(events, command)
        self._accepted = self._reached = self._abandoned = False
        self._busy = events.state.is_busy

    def _advance(self, event: _Event) -> None:
        if isinstance(event, str):
            refused = self._events.refusal(event)
            if refused is not None and refused[0] == self._command:
                self._events.take_refusal(self._command)
                self._failure = refused[1]
        elif isinstance(event, bool):
            if event:
                self._reached = self._accepted
            elif not self._busy:
                self._abandoned = True
        else:
            self._busy = event.is_busy
            self._accepted |= event.is_busy
        if self._ended_at is None and not self._busy and (self._accepted or self._abandoned):
            self._ended_at = monotonic()

    def _is_finished(self) -> bool:
        if self._abandoned and self._graced():
            self._failure = (
                f"{self._events.arm}: {self._command} was abandoned before its goal: by hold, free, a change"
                " of the operating state, or another command"
            )
        done = self._accepted and not self._busy and not self._abandoned
        return done and (self._reached or self._graced())


class StateChange(Handle):
    """A `state_command`."""

    def __init__(self, events: ArmEvents, command: str, holds: Callable[[OperatingState], bool]) -> None:
        """`holds`: returns whether an operating state is the commanded state."""
        super().__init__(events, command)
        self._holds, self._done = holds, False

    def _advance(self, event: _Event) -> None:
        if isinstance(event, str):
            refused = self._events.refusal(event)
            about_state = "state_command" in event
            if about_state and (refused is None or refused[0] == "state_command"):
                self._failure = self._failure or event
        elif isinstance(event, OperatingState):
            self._done = self._holds(event)

    def _is_finished(self) -> bool:
        return self._done
