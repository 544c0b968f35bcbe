"""Compares the state hashes of a running session with the hashes of a recording."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from hub.planning.plan import Plan, PlannedParticipant
from hub.recording.recording import Recording
from schemas.lockstep import Ack

__all__ = ["HashComparison"]


class HashComparison:
    """Compares every state hash with the recorded hash of the same step, whatever the grants.

    Args:
        recording: The recording.
        plan: The plan of the running session.
        until: The first step with allowed differences; None: no step.
    """

    def __init__(self, recording: Recording, plan: Plan, until: int | None = None) -> None:
        self._recorded = {
            name: _recorded_hashes(recording, plan.participants[name])
            for name in plan.order
            if name in recording.plan().participants
        }
        self._order, self._until = plan.order, until
        self._differences: list[tuple[int, int]] = []
        self.hashes = 0
        """State hashes compared."""
        self.stop: Callable[[], None] = lambda: None
        """Is called at the first difference."""

    @property
    def first(self) -> tuple[int, str] | None:
        """Step and participant of the first difference; None if there is none."""
        if not self._differences:
            return None
        step, place = min(self._differences)
        return step, self._order[place]

    def compare_ack(self, planned: PlannedParticipant, ack: Ack) -> None:
        """Compare an ack."""
        recorded = self._recorded.get(planned.name)
        if recorded is None:
            return
        for found in _step_hashes(planned, ack):
            if self._until is not None and found[0] >= self._until:
                return
            expected = next(recorded, None)
            if expected is None:
                return  # the recording was cut short between the grant and this ack
            self.hashes += 1
            if found != expected:
                self._differences.append((min(found[0], expected[0]), self._order.index(planned.name)))
                self.stop()
                return


def _recorded_hashes(recording: Recording, planned: PlannedParticipant) -> Iterator[tuple[int, int]]:
    for ack in recording.acks(planned.name):
        yield from _step_hashes(planned, Ack(ack.run, ack.epoch, ack.step, ack.state_hash.tolist(), (), ()))


def _step_hashes(planned: PlannedParticipant, ack: Ack) -> Iterator[tuple[int, int]]:
    """Yield the number and the hash of each step of an ack; steps count from the first of the grant."""
    first = -(-ack.step // planned.period) * planned.period
    return ((first + i * planned.period, value) for i, value in enumerate(ack.state_hash))
