"""Diagnoses of a stylus, for people: the condition, and what to do about it."""

from __future__ import annotations

from collections.abc import Mapping

from devices.diagnosis import Level
from devices.haptics.diagnoses import FORCE_DIAGNOSES
from devices.haptics.safety import Condition
from devices.openhaptics.exchange import State
from devices.openhaptics.hdapi import Code, Style
from devices.openhaptics.stylus import Phase

__all__ = ["FOUND", "lost", "present"]

_AGAIN = "it is tried again by itself"
_CALIBRATE: Mapping[int, str] = {
    Style.INKWELL: "put the stylus into the inkwell",
    Style.ENCODER_RESET: "hold the stylus in its reset position and press its button",
}
_CONDITIONS = tuple(Condition)


FOUND = Level.WARN, "it is back, and is used as soon as no other hand of this host holds its dead-man"


def lost(phase: Phase, code: int, cause: str, device: str | None) -> tuple[Level, str]:
    """Return the diagnosis of a stylus that is lost; `cause` is what is known beside the error's code."""
    why = cause or (Code.text(code) if code else "no cause is known")
    if phase is Phase.ABSENT:
        known = (
            f"that the vendor's setup program knows it as '{device}'"
            if device
            else "that the vendor's setup program has it as the default device"
        )
        return (
            Level.ERROR,
            f"it cannot be opened ({why}): see that it is plugged in and switched on, and {known}; {_AGAIN}",
        )
    if phase is Phase.BUSY:
        return (
            Level.ERROR,
            f"another program uses it{f' ({why})' if code else ''}: end that program; {_AGAIN}",
        )
    return Level.ERROR, f"it has failed ({why}){': see to its cable and power' if code else ''}; {_AGAIN}"


def present(state: State, refusal: str) -> tuple[Level, str]:
    """Return the diagnosis of an open stylus; `refusal`: why its limits were refused, or empty."""
    phase = Phase(state.phase)
    if phase is Phase.SETTLING:
        return Level.STALE, "it gives no valid frames; if that lasts, switch it off and on"
    if phase is Phase.UNCALIBRATED:
        do = _CALIBRATE.get(state.code, "calibrate it with the setup program of its vendor")
        return Level.WARN, f"it is not calibrated: {do}"
    if phase is Phase.WARNED:
        cool = "; let its motors cool" if state.code == Code.WARM_MOTORS else ""
        return Level.WARN, f"no force: the device warns of {Code.text(state.code)}{cool}"
    if phase is Phase.UNWATCHED:
        return (
            Level.WARN,
            "no force: the process that watches the servo process is late; is the machine busy?",
        )
    if refusal:
        return Level.ERROR, f"no force: {refusal}"
    return FORCE_DIAGNOSES[_CONDITIONS[state.cause]]
