"""What is repeated on the way to an arm: commands delivered again, and refusals in the same words.

The controllers and the gateways to ROS follow these rules. What is remembered stands in arrays, which the
records of a controller hold as they are.
"""

from __future__ import annotations

from zlib import crc32

import numpy as np

from schemas.vectors import Vector

__all__ = ["RememberedCommands", "is_recent", "refusals_to_report"]

_REMEMBERED = 8
"""State commands that an arm remembers, to refuse a second delivery; no more clients command one arm."""
_QUIET_S = 2.0
"""s before a refusal in the same words is reported again (mtsIntuitiveResearchKitArm.cpp, ArmIsReady)."""


class RememberedCommands:
    """Finds state commands delivered twice.

    State commands are latched: a client connecting again delivers the last again.
    """

    def __init__(self) -> None:
        self.state = np.zeros((_REMEMBERED, 3))
        """Stamps (s, ns) and checksums of the last commands that were new, the newest first."""

    def is_repeated(self, sec: int, nanosec: int, text: str = "") -> bool:
        """Return whether a command was delivered before; otherwise remember it.

        A command without a stamp is always new.

        Args:
            sec: stamp of the command, s.
            nanosec: the rest of its stamp, ns.
            text: what is commanded, where commands of the same stamp may differ.
        """
        if not (sec or nanosec):
            return False
        mark = np.array([sec, nanosec, crc32(text.encode())], np.float64)
        if (self.state == mark).all(axis=1).any():
            return True
        self.state[1:] = self.state[:-1].copy()
        self.state[0] = mark
        return False


def refusals_to_report(last: Vector, words: str, now_ns: int) -> int:
    """Count a refusal; return how often it occurred since its last report, 0 while that is too recent.

    Args:
        last: checksum of the last refusal, when it was reported (s), how often it recurred since; updated.
        words: of this refusal.
        now_ns: the time, ns.
    """
    checksum = float(crc32(words.encode()))
    if last[0] == checksum and is_recent(last, now_ns):
        last[2] += 1.0
        return 0
    count = int(last[2]) + 1 if last[0] == checksum else 1
    last[:] = checksum, now_ns * 1e-9, 0.0
    return count


def is_recent(last: Vector, now_ns: int) -> bool:
    """Return whether a refusal (see `refusals_to_report`) is not reported again yet."""
    return bool(now_ns * 1e-9 - last[1] < _QUIET_S)
