"""What an arm says in events: its operating state, whether goals were reached, errors, warnings and news."""

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
        """Take the arm's name and those of its event ports."""
        self._arm = arm
        self._ports = {name: f"{arm}/{name}" for name in events}
        self.outputs: dict[str, tuple[Message, ...]] = dict.fromkeys(self._ports.values(), ())
        self._quiet = True
        self._now_ns = 0
        self.state = np.zeros((len(_STREAMS), 3))
        """Per stream: checksum of the last refusal's words, when it was told, how often it came since then.
        """

    def begin(self, now_ns: int) -> None:
        """Forget what was said; the step that begins ends at `now_ns`."""
        self._now_ns = now_ns
        if not self._quiet:
            self.outputs.update(dict.fromkeys(self._ports.values(), ()))
            self._quiet = True

    def operating_state(self, state: State, *, homed: bool, busy: bool) -> None:
        """Tell the operating state."""
        stamp = Time.from_ns(self._now_ns)
        self._put(
            "operating_state",
            OperatingState(header=Header(stamp=stamp), state=state.name, is_homed=homed, is_busy=busy),
        )

    def desired_state(self, state: str) -> None:
        """Tell where the arm was told to go."""
        self._put("desired_state", StringMessage(data=state))

    def equipment(self, event: str, name: str) -> None:
        """Tell on `tool_type` or `endoscope_type` what the arm holds."""
        self._put(event, StringMessage(data=name))

    def goal_reached(self, *, reached: bool) -> None:
        """Tell whether a move has arrived."""
        self._put("goal_reached", BoolMessage(data=reached))

    def error(self, text: str) -> None:
        """Tell what cannot be done."""
        self._put("error", StringMessage(data=f"{self._arm}: {text}"))

    def warning(self, text: str) -> None:
        """Tell what is not done now."""
        self._put("warning", StringMessage(data=f"{self._arm}: {text}"))

    def status(self, text: str) -> None:
        """Tell what happens."""
        self._put("status", StringMessage(data=f"{self._arm}: {text}"))

    def refuse(self, command: str, reason: str, *, ready: bool) -> None:
        """Say why `command` is not heeded: an error if it cannot be, a warning if it came while the arm was
        not `ready`.

        A stream is told the same only once in two seconds, with how often it came.
        """
        count = self._repeats(command, reason) if command in _STREAMS else 1
        if count:
            text = f"{command} refused: {reason}" + (f" ({count} times)" if count > 1 else "")
            (self.error if ready else self.warning)(text)

    def heeded(self, command: str) -> None:
        """Note that a command was heeded, so that the next refusal is news."""
        if command in _STREAMS:
            self.state[_STREAMS.index(command)] = 0.0

    def _repeats(self, command: str, reason: str) -> int:
        """Return how often the same refusal has come since it was last told; 0 while it is too early to tell
        it again.
        """
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
