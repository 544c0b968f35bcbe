"""Wall-clock stamps: those of one topic strictly increase, as a CRTK client takes no state that is not newer
than the last.
"""

from __future__ import annotations

from time import time_ns

from schemas.message import Message
from schemas.ros import Header, Time

__all__ = ["Stamps", "stamp_of", "stamped"]


class Stamps:
    """The stamps of one topic."""

    def __init__(self) -> None:
        """Begin with none."""
        self._last_ns = 0

    def next_ns(self) -> int:
        """Return the wall time (ns), or the least that is newer than the last, if the clock was set back."""
        self._last_ns = max(time_ns(), self._last_ns + 1)
        return self._last_ns


def stamped(message: Message, stamp_ns: int) -> Message:
    """Return `message` with this stamp; as it is if its type has none."""
    header = getattr(message, "header", None)
    if not isinstance(header, Header):
        return message
    return message.model_copy(update={"header": header.model_copy(update={"stamp": Time.from_ns(stamp_ns)})})


def stamp_of(message: Message) -> int | None:
    """Return the stamp (ns); None if the type has none."""
    header = getattr(message, "header", None)
    return header.stamp.ns if isinstance(header, Header) else None
