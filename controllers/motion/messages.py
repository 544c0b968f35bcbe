"""The events of one arm: its operating state, whether goals were reached, errors, warnings, status."""

from __future__ import annotations

from collections.abc import Iterable
from zlib import crc32

import numpy as np

from controllers.motion.operating_state import State
from robots.dvrk import crtk
from schemas.crtk import OperatingState
from schemas.message import Message
from schemas.ros import BoolMessage, Header, StringMessage, Time

__all__ = ["Messages"]

_STREAMS = tuple(filter(crtk.is_stream, crtk.COMMANDS)) + tuple(
    f"{gripper}/{command}"
    for gripper in ("jaw", "hand")
    for command in filter(crtk.is_stream, crtk.GRIPPER_COMMANDS)
)


class Messages:
    """The event outputs of one arm in the present step."""

    def __init__(self, arm: str, events: Iterable[str]) -> None:
        """Take the arm's name and those of its event outputs."""
        self._arm = arm
        self._ports = {name: f"{arm}/{name}" for name in events}
        self.outputs: dict[str, tuple[Message, ...]] = dict.fromkeys(self._ports.values(), ())
        self._quiet = True
        self._now_ns = 0
        self.state = np.zeros((len(_STREAMS), 3))
        """Per stream: checksum of the last refusal, when it was reported (s), how often it recurred since."""

    def begin(self, now_ns: int) -> None:
        """Clear the events of the last step; the new one ends at `now_ns`."""
        self._now_ns = now_ns
        if not self._quiet:
            self.outputs.update(dict.fromkeys(self._ports.values(), ()))
            self._quiet = True

    def operating_state(self, state: State, *, homed: bool, busy: bool) -> None:
        """Publish the operating state."""
        stamp = Time.from_ns(self._now_ns)
        self._put(
            "operating_state",
            OperatingState(header=Header(stamp=stamp), state=state.name, is_homed=homed, is_busy=busy),
        )

    def desired_state(self, state: str) -> None:
        """Publish the state that was commanded."""
        self._put("desired_state", StringMessage(data=state))

    def equipment(self, event: str, name: str) -> None:
        """Publish what the arm holds: `event` is `tool_type` or `endoscope_type`."""
        self._put(event, StringMessage(data=name))

    def goal_reached(self, *, reached: bool) -> None:
        """Publish whether a move has arrived."""
        self._put("goal_reached", BoolMessage(data=reached))

    def error(self, text: str) -> None:
        """Publish what cannot be done."""
        self._put("error", StringMessage(data=f"{self._arm}: {text}"))

    def warning(self, text: str) -> None:
        """Publish what is refused at present."""
        self._put("warning", StringMessage(data=f"{self._arm}: {text}"))

    def status(self, text: str) -> None:
        """Publish what happens."""
        self._put("status", StringMessage(data=f"{self._arm}: {text}"))

    def refuse(self, command: str, reason: str, *, ready: bool) -> None:
        """Report why `command` is refused: an error if the arm is `ready` for commands, else a warning.

        For a stream the same refusal is reported once in two seconds, with the number of commands.
        """
        count = self._repeats(command, reason) if command in _STREAMS else 1
        if count:
            text = f"{command} refused: {reason}" + (f" ({count} times)" if count > 1 else "")
            (self.error if ready else self.warning)(text)

    def executed(self, command: str) -> None:
        """Note that a command was executed, so that its next refusal is reported at once."""
        if command in _STREAMS:
            self.state[_STREAMS.index(command)] = 0.0

    def _repeats(self, command: str, reason: str) -> int:
        """Return how often the same refusal occurred since its last report; 0 while that is too recent."""
        row, words, now = (
            self.state[_STREAMS.index(command)],
            float(crc32(reason.encode())),
            self._now_ns * 1e-9,
        )
        if row[0] == words and now - row[1] < crtk.REPEAT_NS * 1e-9:
            row[2] += 1.0
            return 0
        count = int(row[2]) + 1 if row[0] == words else 1
        row[:] = words, now, 0.0
        return count

    def _put(self, name: str, message: Message) -> None:
        self.outputs[self._ports[name]] += (message,)
        self._quiet = False
