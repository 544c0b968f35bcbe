"""The condition of a stylus in the servo process."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["ServoPhase"]


class ServoPhase(IntEnum):
    """The condition of a stylus."""

    ABSENT = 0
    """The stylus could not be opened."""
    SETTLING = 1
    """The stylus has given no valid frames yet."""
    UNCALIBRATED = 2
    READY = 3
    WARNED = 4
    """Pose without force: the driver has reported an error within the last second."""
    BUSY = 5
    """Another program has the stylus."""
    FAULT = 6
    """The stylus or the servo loop has failed."""
    UNWATCHED = 7
    """Pose without force: the watcher of the servo process gives no sign of life."""

    @property
    def is_lost(self) -> bool:
        """Whether this process cannot use the stylus any more: only a new process can."""
        return self in _LOST

    @property
    def has_pose(self) -> bool:
        """Whether the pose in the states is valid."""
        return self in _POSED


_LOST = {ServoPhase.ABSENT, ServoPhase.BUSY, ServoPhase.FAULT}
_POSED = {ServoPhase.READY, ServoPhase.WARNED, ServoPhase.UNWATCHED}
