"""The phases of a stitch."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["StitchPhase"]


class StitchPhase(IntEnum):
    """Phases of a session; a stitch is from APPROACH to PULL."""

    BEGIN = 0
    HOVER = 1
    DESCEND = 2
    CLOSE = 3
    LIFT = 4
    APPROACH = 5
    ALIGN = 6
    DRIVE = 7
    COME = 8
    TAKE = 9
    HOLD = 10
    RELEASE = 11
    LEAVE = 12
    PULL = 13
    RAISE = 14
    PRESENT = 15
    COME_BACK = 16
    TAKE_BACK = 17
    HOLD_BACK = 18
    RELEASE_BACK = 19
    LEAVE_BACK = 20
    DONE = 21
    FAILED = 22
    LET_GO = 23
    """Phase of a hand alone, between DRIVE and COME."""
    STEP_BACK = 24
