"""Every error Trocar raises on purpose.

TrocarError
├── ScenarioError          the scenario cannot be run as written (exit code 2)
│   ├── MissingExtraError  an optional part needs a missing package
│   └── TrustError         a recording asks for code or files without permission
├── MessageError           invalid bytes or values of a message
│   └── LateError          a message arrives after a newer message
├── SessionError           the running session ended before its time (exit code 1)
│   ├── ParticipantError   a participant raised, died or stopped answering
│   └── StateError         a participant cannot save or restore its state
├── RecordingError         a recording cannot be written, read or re-simulated
│   └── CutShortError      a recording has no end: `trocar recover` saves the whole chunks
├── MotionError            an arm cannot reach or hold a commanded position
├── DeviceError            hardware or its driver cannot be used now
└── ConnectError           no hub, or another hub than the expected hub
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
    """Root of all errors raised by Trocar on purpose."""


class ScenarioError(TrocarError):
    """The scenario cannot be run as written; the message states the place and the allowed values."""

    def __init__(self, message: str, *, path: tuple[str | int, ...] = ()) -> None:
        """Raise with `path` of the invalid value in the scenario: `("participants", "robot", "kind")`."""
        super().__init__(message)
        self.path = path


class MissingExtraError(ScenarioError):
    """A part of the scenario needs a missing package."""

    def __init__(self, part: str, extra: str, package: str, distribution: str = "trocar") -> None:
        """Raise for `part`, in need of `package` from the extra `extra` of `distribution`."""
        super().__init__(
            f"{part} needs the package '{package}', which is not installed. Install it with: pip install"
            f" '{distribution}[{extra}]'"
        )
        self.extra = extra


class TrustError(ScenarioError):
    """A recording asks for foreign code or for files, without the user's permission."""


class MessageError(TrocarError):
    """Invalid bytes or values of a message."""


class LateError(MessageError):
    """A message arrives after a newer message."""


class SessionError(TrocarError):
    """The running session ended before its time."""


class ParticipantError(SessionError):
    """A participant raised, died or stopped answering; see `participant`, `step` and `cause`."""

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
    """An arm cannot reach or hold a commanded position; the message states the reason and the limits."""


class DeviceError(TrocarError):
    """Hardware or its driver cannot be used now; the message states the remedy."""


class ConnectError(TrocarError):
    """No hub, or another hub than the expected hub."""


_MOST_NAMES = 30
"""Largest number of known names listed beside a suggestion."""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return `" Did you mean 'x'?"` for a near miss, then the known names; a long list is left out then."""
    names = sorted(known)
    close = difflib.get_close_matches(word, names, n=1, cutoff=0.6)
    hint = f" Did you mean '{close[0]}'?" if close else ""
    if close and len(names) > _MOST_NAMES:
        return hint
    return f"{hint} Known: {', '.join(names) or 'none'}."
