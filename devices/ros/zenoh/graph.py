"""The ROS graph on Zenoh: programs by their liveliness tokens, and the sender of each message."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Collection

from xxhash import xxh3_128_digest

from devices.ros.transport import Client
from devices.ros.zenoh.layout import GraphToken

__all__ = ["Graph", "gid_of", "unidentified"]

_UNIDENTIFIED = "publisher "
"""Beginning of the name of a sender without a known token; its gid follows."""
_LEFT = 1000
"""Removed publishers remembered; a leading program is free to others after a second anyway."""


def gid_of(key: str) -> bytes:
    """Return rmw_zenoh's gid for a token's key: XXH3 with 128 bits, the low half first."""
    return xxh3_128_digest(key.encode())[::-1]


def unidentified(gid: bytes) -> str:
    """Return the name of a sender without a known token."""
    return f"{_UNIDENTIFIED}{gid.hex()}"


class Graph:
    """All programs of the graph but our own; for use from any thread.

    A program is a Zenoh session with the name of the session's first node.
    """

    def __init__(self, own_session: str) -> None:
        """`own_session`: id of our session, with ignored tokens."""
        self._own = own_session
        self._changing = threading.Lock()
        self._tokens: dict[str, GraphToken] = {}
        """Tokens by key."""
        self._names: dict[str, str] = {}
        """Names of programs by session."""
        self._senders: dict[bytes, str] = {}
        """Key of the token by gid of the publisher, also where the gid is not a hash of the key."""
        self._left: deque[bytes] = deque(maxlen=_LEFT)
        """Hashes of the removed tokens of publishers."""

    def add(self, key: str) -> bool:
        """Add the token with this key; return whether it is the first of a program."""
        token = GraphToken.parse_token(key)
        if token is None or token.session == self._own:
            return False
        with self._changing:
            self._tokens[key] = token
            if is_new := token.session not in self._names:
                taken = token.node in self._names.values()
                self._names[token.session] = f"{token.node} ({token.session})" if taken else token.node
            return is_new

    def remove(self, key: str) -> None:
        """Remove the token with this key."""
        with self._changing:
            token = self._tokens.pop(key, None)
            if token is None:
                return
            if token.kind == "MP":
                self._left.append(gid_of(key))
            self._senders = {gid: its for gid, its in self._senders.items() if its != key}
            if all(other.session != token.session for other in self._tokens.values()):
                del self._names[token.session]

    def sender(self, topic: str, gid: bytes) -> str | None:
        """Return the name of the program sending on `topic` as the publisher `gid`; None without its token.

        A publisher with a gid other than the hash of its token's key (clients other than rmw_zenoh) is
        identified as the only unidentified publisher of the topic; two such publishers on a topic from the
        beginning are not identified.
        """
        with self._changing:
            key = self._senders.get(gid)
            if key is None:
                identified = set(self._senders.values())
                others = [
                    key
                    for key, token in self._tokens.items()
                    if token.kind == "MP" and token.topic == topic and key not in identified
                ]
                by_hash = next((other for other in others if gid_of(other) == gid), None)
                key = by_hash if by_hash is not None else others[0] if len(others) == 1 else None
                if key is None:
                    return None
                self._senders[gid] = key
            return self._names[self._tokens[key].session]

    def has_left(self, gid: bytes) -> bool:
        """Return whether the publisher `gid` had a token that is gone."""
        with self._changing:
            return gid in self._left

    def present_name(self, name: str) -> str | None:
        """Return the present name of the sender once named `name`; None: the program has left.

        A sender named by a gid (`unidentified`) can become a program, and leave.
        """
        with self._changing:
            if "/" in name:  # of a program
                return name if name in self._names.values() else None
            gid = bytes.fromhex(name.removeprefix(_UNIDENTIFIED))
            if gid in self._left:
                return None
            publishers = (key for key, token in self._tokens.items() if token.kind == "MP")
            key = self._senders.get(gid) or next((key for key in publishers if gid_of(key) == gid), None)
            return name if key is None else self._names[self._tokens[key].session]

    def clients(self, topics: Collection[str]) -> tuple[Client, ...]:
        """Return the programs with a publisher, subscriber, server or client of any of `topics`."""
        with self._changing:
            sessions = dict.fromkeys(
                token.session for token in self._tokens.values() if token.topic in topics
            )
            return tuple(Client(self._names[session], session) for session in sessions)
