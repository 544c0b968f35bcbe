"""Who is in a ROS graph on Zenoh, by the tokens of its programs, and which of them has sent a message."""

from __future__ import annotations

import threading
from collections.abc import Collection

from xxhash import xxh3_128_digest

from devices.ros.transport import Client
from devices.ros.zenoh.layout import Endpoint

__all__ = ["Graph", "gid_of"]


def gid_of(token: str) -> bytes:
    """Return the id that rmw_zenoh makes of a token: XXH3 with 128 bits, the low half first."""
    return xxh3_128_digest(token.encode())[::-1]


class Graph:
    """The other programs.

    A program is a session of Zenoh, and is called like the first node of it; may be used from any thread.
    """

    def __init__(self, own_session: str) -> None:
        """`own_session`: the id of the session whose tokens are not looked at."""
        self._own = own_session
        self._changing = threading.Lock()
        self._there: dict[str, Endpoint] = {}
        """By token."""
        self._names: dict[str, str] = {}
        """By session."""
        self._senders: dict[bytes, str] = {}
        """Token by the id of a publisher, also where that was not made of the token."""

    def came(self, token: str) -> None:
        """Take note of a token."""
        endpoint = Endpoint.of(token)
        if endpoint is None or endpoint.session == self._own:
            return
        with self._changing:
            self._there[token] = endpoint
            if endpoint.session not in self._names:
                taken = endpoint.node in self._names.values()
                self._names[endpoint.session] = (
                    f"{endpoint.node} ({endpoint.session})" if taken else endpoint.node
                )

    def went(self, token: str) -> None:
        """Forget a token."""
        with self._changing:
            endpoint = self._there.pop(token, None)
            if endpoint is None:
                return
            self._senders = {gid: its for gid, its in self._senders.items() if its != token}
            if all(other.session != endpoint.session for other in self._there.values()):
                del self._names[endpoint.session]

    def sender(self, topic: str, gid: bytes) -> str:
        """Return the name of the program that sent a message on `topic` as the publisher `gid`.

        A publisher whose id is not made of its token, as other clients than rmw_zenoh may have it, is known
        as the only one left on its topic; where two such share a topic from the beginning, each goes by its
        id.
        """
        with self._changing:
            token = self._senders.get(gid)
            if token is None:
                named = set(self._senders.values())
                nameless = [
                    t
                    for t, e in self._there.items()
                    if e.kind == "MP" and e.topic == topic and t not in named
                ]
                by_hash = next((t for t in nameless if gid_of(t) == gid), None)
                token = by_hash if by_hash is not None else nameless[0] if len(nameless) == 1 else None
                if token is None:
                    return f"publisher {gid.hex()}"
                self._senders[gid] = token
            return self._names[self._there[token].session]

    def clients(self, topics: Collection[str]) -> tuple[Client, ...]:
        """Return the programs that have to do with any of `topics`."""
        with self._changing:
            sessions = dict.fromkeys(
                endpoint.session for endpoint in self._there.values() if endpoint.topic in topics
            )
            return tuple(Client(self._names[session], session) for session in sessions)
