"""Messages that came before the token of their publisher: held back, as only the token names their program.

A router may deliver both in either order, and tokens are read in another thread than messages. Without its
name, the second publisher of a program that commands an arm would be refused as another program.
"""

from __future__ import annotations

import threading
from collections import Counter, deque
from dataclasses import dataclass
from time import monotonic

from devices.ros.transport import MessageHandler
from devices.ros.zenoh.graph import Graph, unidentified

__all__ = ["EarlyMessages"]

_PATIENCE_S = 0.5
"""Time until a publisher counts as one without a token; tokens come within milliseconds."""
_WITHOUT_TOKEN = 1000
"""Remembered publishers without a token: their messages wait once only."""


@dataclass(frozen=True, slots=True)
class _Early:
    """A message held, and what takes it."""

    topic: str
    gid: bytes
    payload: bytes
    receive: MessageHandler
    due_s: float
    """When it is passed on without a name, s."""


class EarlyMessages:
    """Passes messages on with the names of their programs, those of each publisher in order."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._changed = threading.Condition()
        self._held: deque[_Early] = deque()
        """Also holds the message that is being passed on, so that none of its publisher overtakes it."""
        self._held_of: Counter[bytes] = Counter()
        """Number of messages held, by publisher."""
        self._without_token: deque[bytes] = deque(maxlen=_WITHOUT_TOKEN)
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="early messages", daemon=True)
        self._thread.start()

    def receive(self, topic: str, gid: bytes, payload: bytes, receive: MessageHandler) -> None:
        """Pass a message of the publisher `gid` on, at once if its program is known."""
        with self._changed:
            name = self._name(topic, gid)
            if name is None or self._held_of[gid]:
                self._held.append(_Early(topic, gid, payload, receive, monotonic() + _PATIENCE_S))
                self._held_of[gid] += 1
                self._changed.notify()
                return
        receive(payload, name)

    def note_token(self) -> None:
        """Look again whose messages are held: a token has come."""
        with self._changed:
            self._changed.notify()

    def _name(self, topic: str, gid: bytes) -> str | None:
        if (name := self._graph.sender(topic, gid)) is not None:
            return name
        waits_no_more = gid in self._without_token or self._graph.has_left(gid)
        return unidentified(gid) if waits_no_more else None

    def _run(self) -> None:
        while (found := self._await_first()) is not None:
            early, name = found
            early.receive(early.payload, name)
            with self._changed:
                self._held.popleft()
                self._held_of -= Counter((early.gid,))  # keeps no publisher at 0

    def _await_first(self) -> tuple[_Early, str] | None:
        """Return the first message held and the name of its program; None at the end."""
        with self._changed:
            while not self._closed:
                if not self._held:
                    self._changed.wait()
                    continue
                early = self._held[0]
                if (name := self._name(early.topic, early.gid)) is not None:
                    return early, name
                if (left_s := early.due_s - monotonic()) <= 0.0:
                    self._without_token.append(early.gid)
                else:
                    self._changed.wait(left_s)
            return None

    def close(self) -> None:
        """Drop the messages held."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        self._thread.join()
