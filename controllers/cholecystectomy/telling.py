"""What a routine says: statuses, and a sentence after it has given up."""

from __future__ import annotations

from collections.abc import Iterable

from controllers.cholecystectomy.surgeon_hand import SurgeonHand

__all__ = ["Telling"]


class Telling:
    """Statuses of the present step, and the reason to give up."""

    def __init__(self) -> None:
        self.failure = ""
        """Sentence after giving up."""
        self._status: list[str] = []

    def statuses(self) -> tuple[str, ...]:
        """Return and clear the statuses of this step."""
        said = tuple(self._status)
        self._status.clear()
        return said

    def say(self, text: str) -> None:
        """Add a status."""
        self._status.append(text)

    def give_up(self, why: str, hands: Iterable[SurgeonHand]) -> None:
        """Say why, and let all hands stay."""
        self.failure = f"given up{why}"
        self.say(self.failure)
        for hand in hands:
            hand.stay()
