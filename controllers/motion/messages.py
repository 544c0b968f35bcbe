"""The events of an arm: operating state, reached goals, errors, warnings, status."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from controllers.motion.operating_state import State
from robots.dvrk import crtk
from robots.dvrk.repeats import refusals_to_report
from schemas.crtk import OperatingState
from schemas.message import Message
from schemas.ros import BoolMessage, EmptyMessage, Header, StringMessage, Time

__all__ = ["Messages"]

_OTHER = "other"
"""Placeholder for the name of an end effector without a jaw."""
_STREAMS = {
    command: row
    for row, command in enumerate(
        (
            *filter(crtk.is_stream, crtk.COMMANDS),
            *(
                f"{gripper}/{command}"
                for gripper in ("jaw", _OTHER)
                for command in filter(crtk.is_stream, crtk.GRIPPER_COMMANDS)
            ),
        )
    )
}
"""Streamed commands, and the row of each in `Messages.state`."""


def _row(command: str) -> int | None:
    """Return the row of a streamed command."""
    word = command.rpartition("/")[2]
    return _STREAMS.get(command, _STREAMS.get(f"{_OTHER}/{word}"))


class Messages:
    """The event outputs of an arm in the present step."""

    def __init__(self, arm: str, events: Iterable[str], outputs: dict[str, Any]) -> None:
        """`events`: names of the arm's event outputs; `outputs`: the controller's outputs."""
        self._arm, self._outputs = arm, outputs
        self._ports = {name: f"{arm}/{name}" for name in events}
        self._silence = dict.fromkeys(self._ports.values(), ())
        outputs |= self._silence
        self.quiet = True
        """Whether the present step has no events."""
        self._now_ns = 0
        self.state = np.zeros((len(_STREAMS), 3))
        """Last refusal of each stream: checksum, time of the report (s), number of recurrences."""

    def begin(self, now_ns: int) -> None:
        """Clear the events of the last step; the new step ends at `now_ns`."""
        self._now_ns = now_ns
        if not self.quiet:
            self._outputs |= self._silence
            self.quiet = True

    def operating_state(self, state: State, *, homed: bool, busy: bool) -> None:
        """Publish the operating state."""
        stamp = Time.from_ns(self._now_ns)
        self._put(
            "operating_state",
            OperatingState(header=Header(stamp=stamp), state=state.name, is_homed=homed, is_busy=busy),
        )

    def desired_state(self, state: str) -> None:
        """Publish the commanded state."""
        self._put("desired_state", StringMessage(data=state))

    def equipment(self, event: str, name: str) -> None:
        """Publish the arm's equipment: `event` is `tool_type` or `endoscope_type`."""
        self._put(event, StringMessage(data=name))

    def orientation_locked(self, *, locked: bool) -> None:
        """Publish whether the orientation of a master is locked."""
        self._put("orientation_locked", BoolMessage(data=locked))

    def gripper(self, *, closed: bool) -> None:
        """Publish that the gripper of a master has closed or opened."""
        self._put("gripper/closed", BoolMessage(data=closed))
        if closed:
            self._put("gripper/pinch", EmptyMessage())

    def goal_reached(self, *, reached: bool) -> None:
        """Publish whether a move has arrived."""
        self._put("goal_reached", BoolMessage(data=reached))

    def error(self, text: str) -> None:
        """Publish an error: an impossible command."""
        self._put("error", StringMessage(data=f"{self._arm}: {text}"))

    def warning(self, text: str) -> None:
        """Publish a warning: a command refused at present."""
        self._put("warning", StringMessage(data=f"{self._arm}: {text}"))

    def status(self, text: str) -> None:
        """Publish a status text."""
        self._put("status", StringMessage(data=f"{self._arm}: {text}"))

    def refuse(self, command: str, reason: str, *, ready: bool) -> None:
        """Report why `command` is refused: an error if the arm is `ready` for commands, else a warning.

        For a stream the same refusal is reported once in two seconds, with the number of commands.
        """
        count = 1
        if (stream := _row(command)) is not None:
            count = refusals_to_report(self.state[stream], reason, self._now_ns)
        if count:
            text = f"{command} refused: {reason}" + (f" ({count} times)" if count > 1 else "")
            (self.error if ready else self.warning)(text)

    def note_executed(self, command: str) -> None:
        """Note an executed command: the next refusal is reported at once."""
        if (stream := _row(command)) is not None:
            self.state[stream] = 0.0

    def _put(self, name: str, message: Message) -> None:
        self._outputs[self._ports[name]] += (message,)
        self.quiet = False
