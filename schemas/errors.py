"""Every error Trocar raises on purpose.

TrocarError
├── ScenarioError          the scenario cannot be run as written (exit code 2)
│   ├── MissingExtraError  a package that an optional part needs is not installed
│   └── TrustError         a recording asks for code or files that were not allowed
├── MessageError           bytes or values that are not a valid message
│   └── LateError          a message that arrives after a newer one
├── SessionError           the running session ended before its time (exit code 1)
│   ├── ParticipantError   a participant raised, died or stopped answering
│   └── StateError         a participant cannot save or restore its state
├── RecordingError         a recording cannot be written, read or re-simulated
│   └── CutShortError      a recording has no end: `trocar recover` saves what is whole
├── MotionError            an arm cannot be or go where it was asked to
├── DeviceError            hardware, or the program that drives it, cannot be used now
└── ConnectError           no hub, or not the hub that was asked for
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable

__all__ = [
    "ConnectError",
    "CutShortError",
    "DeviceError",
    "LateError",
    "MessageError",
    "MissingExtraError",
    "MotionError",
    "ParticipantError",
    "RecordingError",
    "ScenarioError",
    "SessionError",
    "StateError",
    "TrocarError",
    "TrustError",
    "did_you_mean",
]


class TrocarError(Exception):
    """Root of all errors that Trocar raises on purpose."""


class ScenarioError(TrocarError):
    """The scenario cannot be run as written; the message states where and what was allowed."""

    def __init__(self, message: str, *, path: tuple[str | int, ...] = ()) -> None:
        """Raise with `path` of the invalid value in the scenario: `("participants", "robot", "kind")`."""
        super().__init__(message)
        self.path = path


class MissingExtraError(ScenarioError):
    """A part of the scenario needs a package that is not installed here."""

    def __init__(self, part: str, extra: str, package: str, distribution: str = "trocar") -> None:
        """Raise for `part`, which needs `package` from the extra `extra` of `distribution`."""
        super().__init__(
            f"{part} needs the package '{package}', which is not installed. Install it with: pip install"
            f" '{distribution}[{extra}]'"
        )
        self.extra = extra


class TrustError(ScenarioError):
    """A recording asks for code that is not installed, or for files, and the user has not allowed it."""


class MessageError(TrocarError):
    """Bytes or values that are not a valid message."""


class LateError(MessageError):
    """A message that arrives after a newer one."""


class SessionError(TrocarError):
    """The running session ended before its time."""


class ParticipantError(SessionError):
    """A participant raised, died or stopped answering; `participant` and `step` are which and when."""

    def __init__(self, participant: str, step: int, cause: str) -> None:
        super().__init__(f"participant '{participant}' failed at step {step}: {cause}")
        self.participant = participant
        self.step = step
        self.cause = cause


class StateError(SessionError):
    """A participant cannot save or restore its state."""


class RecordingError(TrocarError):
    """A recording cannot be written, read or re-simulated."""


class CutShortError(RecordingError):
    """A recording has no end: its writer was killed, or the disk was full."""


class MotionError(TrocarError):
    """An arm cannot be or go where it was asked to; the message states why and what was allowed."""


class DeviceError(TrocarError):
    """Hardware, or the program that drives it, cannot be used now; the message states what to do."""


class ConnectError(TrocarError):
    """No hub, or not the hub that was asked for."""


_MOST_NAMES = 30
"""Known names that are listed although one of them is probably meant."""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return `" Did you mean 'x'?"` for a near miss, then what is known; a long list if nothing is near."""
    names = sorted(known)
    close = difflib.get_close_matches(word, names, n=1, cutoff=0.6)
    hint = f" Did you mean '{close[0]}'?" if close else ""
    if close and len(names) > _MOST_NAMES:
        return hint
    return f"{hint} Known: {', '.join(names) or 'none'}."
