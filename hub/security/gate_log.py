"""What Zenoh's log says of who came to the gate and what was refused to them, in our words.

Written after the lines of Zenoh 1.10: an access rule that refuses says so at level trace alone, and a
handshake that fails does not say with whom.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass

__all__ = ["LISTENED_TO", "GateLog"]

LISTENED_TO = "error,zenoh_link_tls=debug,zenoh::net::routing::interceptor::access_control=trace"
"""What of Zenoh's log is needed, as `RUST_LOG` has it."""

Told = tuple[int, str]
"""Level of `logging`, and message."""

_MOST_TOLD = 20
"""So many refusals are told of one connection: a flood must not become one of the hub's log."""

_COLOUR = re.compile(r"\x1b\[[0-9;]*m|[\x00-\x1f\x7f-\x9f]")
"""And whatever else a terminal might obey, as keys come from strangers."""
_CAME = re.compile(r"Accepted TLS connection on \S+: (?P<address>\S+)\. Common Name: (?P<name>.*)\.$")
_FAILED = re.compile(r" WARN .*zenoh_link_tls\S*: (?P<reason>.*?)(\. Hint: .*)?$")
_LIST = re.compile(r"(?P<thread>ThreadId\(\d+\)).* ACL \(\w+\): caching permissions for `(?P<key>.*)`")
_VERDICT = re.compile(
    r"(?P<thread>ThreadId\(\d+\)).*?(?P<cached>cached result: )?(?P<peer>[0-9a-f]+)( on (?P<subject>\S+))? "
    r"is (?P<verdict>authorized|unauthorized) to (?P<deed>.+?) \((?P<flow>\w+)\) on (?P<key>\S+)$"
)
_NAME = re.compile(r"CertCommonName\((.*?)\)")

_REASONS = {
    "UnknownIssuer": "its certificate is of another authority",
    "BadSignature": "its certificate is of another authority",
    "certificate expired": "its certificate has expired",
    "peer sent no certificates": "it shows no certificate",
    "InvalidContentType": "it does not speak TLS",
    "alert: UnknownCA": "it does not know the authority of the hub's certificate",
    "alert: DecryptError": "it does not know the authority of the hub's certificate",
    "alert: BadCertificate": "it does not accept the hub's certificate",
    "alert: CertificateUnknown": "it does not accept the hub's certificate",
    "extended key usage": "its certificate is not that of a participant",
    "handshake eof": "it hung up",
}


@dataclass
class _List:
    """The verdicts that Zenoh passes beforehand on every kind of message in both directions, as soon as
    somebody at the other end names a key.
    """

    key: str
    peer: str = ""
    nothing_allowed: bool = True
    left: int = 18
    """Nine kinds of messages in two directions."""


class GateLog:
    """Reads Zenoh's log line by line."""

    def __init__(self, known: Collection[str]) -> None:
        """`known`: the names in certificates for which there are access rules."""
        self._known = known
        self._addresses: dict[str, str] = {}
        self._let_in: set[str] = set()
        self._names: dict[str, str] = {}
        self._lists: dict[str, _List] = {}
        self._told: dict[str, set[str]] = {}

    def read(self, line: str) -> Iterator[Told]:
        """Yield what is to be told after a line."""
        if not self._lists and " is authorized " in line:  # nearly all lines are of this kind
            return
        text = _COLOUR.sub("", line.rstrip())
        if came := _CAME.search(text):
            yield self._greet(came["name"], came["address"])
        elif failed := _FAILED.search(text):
            reason = next(
                (words for sign, words in _REASONS.items() if sign in failed["reason"]), failed["reason"]
            )
            yield logging.WARNING, f"refused a connection: {reason}"
        elif begun := _LIST.search(text):
            if self._lists.get(begun["thread"], _List("")).key != begun["key"]:
                yield from self._close_list(begun["thread"])
                self._lists[begun["thread"]] = _List(begun["key"])
        elif verdict := _VERDICT.search(text):
            yield from self._judge(verdict)

    def ended(self, address: str) -> Iterator[Told]:
        """Yield what is to be told when a connection from `address` has ended."""
        if address in self._let_in:
            self._let_in.discard(address)
        else:
            yield logging.WARNING, f"the connection from {address} was not let in"

    def _greet(self, name: str, address: str) -> Told:
        self._addresses[name] = address
        self._let_in.add(address)
        self._told.pop(name, None)
        if name in self._known:
            return logging.INFO, f"'{name}' connects from {address}"
        return (
            logging.WARNING,
            (
                f"'{name}' connects from {address}, but no remote participant of this session has that name:"
                " it gets nothing"
            ),
        )

    def _judge(self, verdict: re.Match[str]) -> Iterator[Told]:
        """Tell of a refusal, unless it stands in a list."""
        if named := _NAME.search(verdict["subject"] or ""):
            self._names[verdict["peer"]] = named[1]
        refused = verdict["verdict"] == "unauthorized"
        listed = self._lists.get(verdict["thread"])
        if listed is not None and listed.key == verdict["key"] and not verdict["cached"]:
            listed.peer = verdict["peer"]
            listed.nothing_allowed &= refused
            listed.left -= 1
            if not listed.left:
                yield from self._close_list(verdict["thread"])
            return
        yield from self._close_list(verdict["thread"])
        if refused and verdict["flow"] == "ingress":
            yield from self._tell(verdict["peer"], f"{verdict['deed'].lower()} on {verdict['key']}")

    def _close_list(self, thread: str) -> Iterator[Told]:
        """Tell of a key that was named by somebody who may do nothing with it, neither speak nor hear."""
        listed = self._lists.pop(thread, None)
        if listed is not None and listed.nothing_allowed and listed.peer in self._names:
            yield from self._tell(listed.peer, f"say or hear anything on {listed.key}")

    def _tell(self, peer: str, deed: str) -> Iterator[Told]:
        name = self._names.get(peer, "somebody without a name")
        told = self._told.setdefault(name, set())
        if deed in told or len(told) > _MOST_TOLD:
            return
        told.add(deed)
        more = "; what else is refused to it is not told any more" if len(told) > _MOST_TOLD else ""
        yield (
            logging.WARNING,
            f"refused to '{name}' at {self._addresses.get(name, 'an unknown address')}: to {deed}{more}",
        )
