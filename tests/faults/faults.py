"""What may happen to a part of a session, at random, and what the session must do then."""

from __future__ import annotations

import random
from dataclasses import dataclass

from tests.devices.standins import build

__all__ = ["DEVICE", "ENGINE", "GATE", "HUB", "LINK", "REMOTE", "SERVO", "WATCHER", "Fault", "fault_of"]

HUB, ENGINE, DEVICE, REMOTE = "hub", "host one", "host hand", "device hand"
SERVO, WATCHER, GATE, LINK = "servo", "watcher", "gate", "link"

_LONGEST_S = {"birth": 0.9, "servo": 0.3, "run": 0.3, "close": 0.15}
"""How long after the moment a fault comes at most."""


@dataclass(frozen=True)
class Fault:
    """What is done to which part, and when."""

    part: str
    """A process of the session, as `traces.Process.part` names it, or the network `link` of a device."""
    action: str
    """`kill`; `stop` for good; `pause`, a stop of `pause_s`; `cut` or `choke` a link for `pause_s`."""
    moment: str
    """`birth`: when the part's process is made (of the hub: that of its first host); `servo`: when the servo
    process of the device is made; `run`: after the first step; `close`: when the session is ended.
    """
    delay_s: float
    """From the moment to the fault."""
    pause_s: float = 0.1
    long_step: bool = False
    """The engine is in a step that takes long and keeps the interpreter lock."""
    stopped: bool = False
    """The engine's host is stopped before."""
    beside: str = ""
    """A part that the session has as well: the gate, or the remote device."""

    def __str__(self) -> str:
        notes = ", in a long step" * self.long_step + ", with its host stopped" * self.stopped
        notes += f", beside {self.beside}" if self.beside else ""
        return f"{self.action} {self.part}, {self.moment} + {1e3 * self.delay_s:.0f} ms{notes}"

    def concerns(self, *parts: str) -> bool:
        """Whether it is about one of `parts`."""
        return self.part in parts or self.beside in parts

    @property
    def kills_hub(self) -> bool:
        """Whether the hub does not get to an end of its own."""
        return self.part == HUB and self.action in ("kill", "stop")

    @property
    def fails_session(self) -> bool:
        """Whether the hub must end the session because of it."""
        return self.moment != "close" and self.part in (ENGINE, DEVICE) and self.action in ("kill", "stop")

    @property
    def may_not_join(self) -> bool:
        """Whether a remote device may be killed before it joins, for which the hub then waits."""
        return self.part == REMOTE and self.action == "kill" and self.moment == "birth"

    @property
    def may_prevent_start(self) -> bool:
        """Whether the session may end, with a reason, before its first step."""
        return self.may_not_join or (self.part == SERVO and self.moment == "birth")

    @property
    def is_named(self) -> bool:
        """Whether the hub must say which part it is that has failed."""
        lost = (self.part == REMOTE and self.action == "kill") or self.action == "cut"
        return self.fails_session or (lost and self.moment != "close")


def fault_of(source: random.Random) -> Fault:
    """Return a fault at random."""
    parts = [HUB] * 4 + [ENGINE] * 3 + [DEVICE] * 2 + [REMOTE, LINK, GATE]
    if build.USABLE:
        parts += [SERVO, WATCHER]
    part = source.choice(parts)
    moment = source.choice(["birth", "run", "run", "close"])
    action = source.choice(["kill", "kill", "kill", "stop", "pause"])
    if part == LINK:
        moment, action = "run", source.choice(["cut", "choke"])
    elif part in (SERVO, WATCHER, GATE):
        action = "kill"
        moment = "run" if (part, moment) == (GATE, "birth") else moment  # before it listens, the hub ends
    elif part in (DEVICE, REMOTE) and action == "stop":
        action = "pause"  # a device that is silent is stale, which ends nothing
    if part == DEVICE and moment == "birth" and build.USABLE:
        moment = source.choice(["birth", "servo"])
    state, beside = source.choice(["", "", "long step", "stopped"]), source.choice(["", GATE, REMOTE])
    kills_running = part == HUB and action == "kill" and moment == "run"
    return Fault(
        part,
        action,
        moment,
        delay_s=source.random() * _LONGEST_S[moment],
        pause_s=0.05 + 0.25 * source.random(),
        long_step=state == "long step" and kills_running,
        stopped=state == "stopped" and kills_running,
        beside=beside if part == HUB and not state else "",
    )
