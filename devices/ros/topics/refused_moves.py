"""Answer to a client waiting for a move refused by the gateway itself.

A CRTK client waits for an operating state newer than its command and not busy, and for `goal_reached`. The
motion controller publishes both for a refused move, but never hears of a move refused by the gateway.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from time import monotonic_ns

from devices.ros.topics.row import Row
from hub.participant.token_bucket import TokenBucket
from robots.dvrk.crtk import is_move
from schemas.crtk import OperatingState
from schemas.message import Message
from schemas.ros import BoolMessage

__all__ = ["RefusedMoves"]

_PENDING_NS = 1_000_000_000
"""For so long after an accepted move the controller's own operating state is awaited."""
_MOST_PER_S, _BURST = 200, 50
"""Limits of answers to refused moves: a program flooding a topic does not make the gateway flood others."""


class RefusedMoves:
    """Publishes the newest operating state again, and `goal_reached`; for use from any thread."""

    def __init__(self, publish: Callable[[str, Message], None]) -> None:
        """`publish`: publishes a message, stamped now, on an existing port (`PSM1/operating_state`)."""
        self._publish = publish
        self._states: dict[str, OperatingState] = {}
        self._accepted_ns: dict[str, int] = {}
        """Time of the last accepted move without an answering operating state, by owner."""
        self._bucket = TokenBucket(_MOST_PER_S, _BURST)
        self._deciding = threading.Lock()

    def update(self, owner: str, state: OperatingState) -> None:
        """Set the newest operating state of an arm."""
        with self._deciding:
            self._states[owner] = state
            self._accepted_ns.pop(owner, None)

    def accepted(self, row: Row) -> None:
        """Note an accepted message: after a move, the controller publishes the operating state."""
        if is_move(row.name):
            with self._deciding:
                self._accepted_ns[row.owner] = monotonic_ns()

    def refused(self, row: Row) -> None:
        """Answer a refused move, unless the controller is about to publish a newer operating state.

        As of the motion controller, `goal_reached` is false unless another move is under way.
        """
        if not is_move(row.name):
            return
        now_ns = monotonic_ns()
        with self._deciding:
            state = self._states.get(row.owner)
            is_pending = now_ns - self._accepted_ns.get(row.owner, now_ns - _PENDING_NS) < _PENDING_NS
            if state is None or is_pending or not self._bucket.spend(now_ns):
                return
        if not state.is_busy:
            self._publish(f"{row.owner}/goal_reached", BoolMessage(data=False))
        self._publish(f"{row.owner}/operating_state", state)
