"""Diagnoses of a haptic device's force, for people: the condition, and the remedy."""

from __future__ import annotations

from collections.abc import Mapping

from devices.diagnosis import Level
from devices.haptics.safety import Condition

__all__ = ["FORCE_DIAGNOSES"]

FORCE_DIAGNOSES: Mapping[Condition, tuple[Level, str]] = {
    Condition.ON: (Level.OK, "force is on"),
    Condition.OFF: (Level.OK, "no force: the dead-man is not held"),
    Condition.WAITING: (
        Level.WARN,
        (
            "no force yet: the stylus is inside an object; move it out of the contact, and the force rises"
            " slowly"
        ),
    ),
    Condition.SILENT: (
        Level.WARN,
        (
            "no force: no contact model arrives; check that the session runs, that the network is up and that"
            " the input 'contact' is connected"
        ),
    ),
    Condition.TOO_FAST: (
        Level.WARN,
        "no force: the hand was too fast; release the dead-man, then hold it again",
    ),
    Condition.INVALID: (
        Level.ERROR,
        (
            "no force: a position, a velocity or a force is not a number; check the device and the contact"
            " model"
        ),
    ),
}
