"""Reads the clients of the gate and their denials from Zenoh's log.

Written for the log lines of Zenoh 1.10: a denial by an access rule appears at level trace only, and the line
of a failed handshake does not name the client.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass

__all__ = ["LOG_FILTER", "GateLog"]

LOG_FILTER = "error,zenoh_link_tls=debug,zenoh::net::routing::interceptor::access_control=trace"
"""The needed part of Zenoh's log, in the syntax of `RUST_LOG`."""

Report = tuple[int, str]
"""Level of `logging`, and message."""

_MOST_REPORTS = 20
"""Most reported denials per connection: a client must not flood the hub's log."""

_CONTROL = re.compile(r"\x1b\[[0-9;]*m|[\x00-\x1f\x7f-\x9f]")
"""Control characters, colours included: a key is the client's text, and might command a terminal."""
_CONNECTED = re.compile(r"Accepted TLS connection on \S+: (?P<address>\S+)\. Common Name: (?P<name>.*)\.$")
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
    "handshake eof": "it closed the connection",
}


@dataclass
class _List:
    """The verdicts computed by Zenoh in advance, for every kind of message, when a client names a key."""

    key: str
    peer: str = ""
    nothing_allowed: bool = True
    left: int = 18
    """Nine kinds of messages in two directions."""


class GateLog:
    """Turns the lines of Zenoh's log into reports."""

    def __init__(self, known: Collection[str], revoked: Collection[str] = ()) -> None:
        """Start reading.

        Args:
            known: Common names of certificates with access rules.
            revoked: Common names of revoked certificates.
        """
        self._known = known
        self._revoked = revoked
        self._addresses: dict[str, str] = {}
        self._accepted: set[str] = set()
        self._names: dict[str, str] = {}
        self._lists: dict[str, _List] = {}
        self._reported: dict[str, set[str]] = {}

    def read(self, line: str) -> Iterator[Report]:
        """Yield the reports from a line."""
        if not self._lists and " is authorized " in line:  # fast path: most lines are of this kind
            return
        text = _CONTROL.sub("", line.rstrip())
        if connected := _CONNECTED.search(text):
            yield self._accept(connected["name"], connected["address"])
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

    def closed(self, address: str) -> Iterator[Report]:
        """Yield the reports when a connection from `address` has closed."""
        if address in self._accepted:
            self._accepted.discard(address)
        else:
            yield logging.WARNING, f"the connection from {address} was not accepted"

    def _accept(self, name: str, address: str) -> Report:
        self._addresses[name] = address
        self._accepted.add(address)
        self._reported.pop(name, None)
        if name in self._known:
            return logging.INFO, f"'{name}' connects from {address}"
        if name in self._revoked:
            return (
                logging.WARNING,
                f"'{name}' connects from {address} with a revoked certificate: it has no rights",
            )
        return (
            logging.WARNING,
            (
                f"'{name}' connects from {address}, but no remote participant of this session has that name:"
                " it has no rights"
            ),
        )

    def _judge(self, verdict: re.Match[str]) -> Iterator[Report]:
        """Yield the report of a denial outside of lists."""
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
            yield from self._report(verdict["peer"], f"{verdict['deed'].lower()} on {verdict['key']}")

    def _close_list(self, thread: str) -> Iterator[Report]:
        """End a list, and report the key if the client may neither publish nor receive there."""
        listed = self._lists.pop(thread, None)
        if listed is not None and listed.nothing_allowed and listed.peer in self._names:
            yield from self._report(listed.peer, f"publish or receive anything on {listed.key}")

    def _report(self, peer: str, deed: str) -> Iterator[Report]:
        name = self._names.get(peer, "a client without a name")
        reported = self._reported.setdefault(name, set())
        if deed in reported or len(reported) > _MOST_REPORTS:
            return
        reported.add(deed)
        more = "; further refusals are not reported" if len(reported) > _MOST_REPORTS else ""
        yield (
            logging.WARNING,
            f"refused to '{name}' at {self._addresses.get(name, 'an unknown address')}: to {deed}{more}",
        )
