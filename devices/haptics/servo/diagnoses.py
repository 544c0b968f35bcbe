"""Diagnoses of a stylus, for people: the condition, and the remedy."""

from __future__ import annotations

from devices.diagnosis import Level
from devices.haptics.diagnoses import FORCE_DIAGNOSES
from devices.haptics.safety import Condition
from devices.haptics.servo.exchange import State
from devices.haptics.servo.phase import ServoPhase

__all__ = ["FOUND", "Words", "describe_loss", "present"]

_AGAIN = "it is tried again by itself"
_CONDITIONS = tuple(Condition)


class Words:
    """A driver's numbers in words; a vendor overrides methods for better words."""

    def error(self, code: int) -> str:
        """Return an error code in words."""
        return f"error {code}"

    def warning(self, code: int) -> str:
        """Return a warning in words, with the remedy."""
        return self.error(code)

    def calibration(self, style: int) -> str:  # noqa: ARG002
        """Return how to calibrate a stylus of a calibration style."""
        return "calibrate it with the setup program of its vendor"


FOUND = Level.WARN, "it is back, and is used as soon as no other hand of this host holds its dead-man"


def describe_loss(phase: ServoPhase, error: str, cause: str, device: str | None) -> tuple[Level, str]:
    """Return the diagnosis of a lost stylus.

    Args:
        phase: ABSENT, BUSY or FAULT.
        error: the library's error in words, or empty.
        cause: further facts, or empty.
        device: name of the device in the vendor's configuration.
    """
    why = cause or error or "no cause is known"
    if phase is ServoPhase.ABSENT:
        known = (
            f"that the vendor's setup program knows it as '{device}'"
            if device
            else "that the vendor's setup program has it as the default device"
        )
        return (
            Level.ERROR,
            f"it cannot be opened ({why}): see that it is plugged in and switched on, and {known}; {_AGAIN}",
        )
    if phase is ServoPhase.BUSY:
        return (
            Level.ERROR,
            f"another program uses it{f' ({why})' if error else ''}: end that program; {_AGAIN}",
        )
    return Level.ERROR, f"it has failed ({why}){': see to its cable and power' if error else ''}; {_AGAIN}"


def present(state: State, words: Words, refusal: str) -> tuple[Level, str]:
    """Return the diagnosis of an open stylus; `refusal`: why the limits were refused, or empty."""
    phase = ServoPhase(state.phase)
    if phase is ServoPhase.SETTLING:
        return Level.STALE, "it gives no valid frames; if that lasts, switch it off and on"
    if phase is ServoPhase.UNCALIBRATED:
        return Level.WARN, f"it is not calibrated: {words.calibration(state.code)}"
    if phase is ServoPhase.WARNED:
        return Level.WARN, f"no force: the device warns of {words.warning(state.code)}"
    if phase is ServoPhase.UNWATCHED:
        return (
            Level.WARN,
            "no force: the process that watches the servo process is late; is the machine busy?",
        )
    if refusal:
        return Level.ERROR, f"no force: {refusal}"
    return FORCE_DIAGNOSES[_CONDITIONS[state.cause]]
