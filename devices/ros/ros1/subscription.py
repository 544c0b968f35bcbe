"""Topics that a node of ROS 1 listens to, and the programs that publish them."""

from __future__ import annotations

import logging
import socket
import threading
from collections.abc import Iterable
from functools import partial
from time import monotonic, time_ns

from devices.ros.ros1.api import Program
from devices.ros.ros1.connection import Connection, Fields, Incoming, header_frame
from devices.ros.ros1.loop import Loop
from devices.ros.ros1.types import Wire, checksum, definition, ros1_name
from devices.ros.topics.row import Row
from devices.ros.transport import Taker
from schemas.errors import DeviceError, MessageError

__all__ = ["Subscription", "Subscriptions"]

log = logging.getLogger(__name__)

_CONNECT_S = 2.0
_SOONEST_S, _LATEST_S = 0.5, 30.0
"""How long it takes until a connection that failed is tried again, at first and at last; rospy has the same.
"""
_KEPT_S = 0.5
"""What a publisher has kept for those who come later follows its header at once: within a few milliseconds,
or some tens on a busy machine. What comes later than this is meant now.
"""
_UNREACHED = (
    "ROS 1: the program at %s, which publishes %s, is not reached: %s. Its ROS_IP or ROS_HOSTNAME must be an"
    " address that this machine knows"
)
_NO_MESSAGE = b"\xff\xff"
"""Stands before bytes that could not be made CDR, which it cannot begin with."""


class Subscription:
    """One topic, and what takes its messages."""

    def __init__(self, row: Row, take: Taker, node: str) -> None:
        """Take the topic, what takes its messages, and the name of our node."""
        self.topic, self._take, self._wire = row.topic, take, Wire(row.type)
        self._md5 = checksum(row.type)
        self.header = {
            "callerid": node,
            "md5sum": self._md5,
            "message_definition": definition(row.type),
            "tcp_nodelay": "1",
            "topic": row.topic,
            "type": ros1_name(row.type),
        }

    def check(self, fields: Fields) -> None:
        """Raise MessageError if a publisher's header says that it publishes something else, or nothing."""
        if "error" in fields:
            raise MessageError(f"{self.topic}: {fields['error']}")
        if fields.get("md5sum", "*") not in (self._md5, "*"):
            raise MessageError(
                f"{self.topic} has MD5 {self._md5}, not {fields['md5sum']}: its messages are of another"
                " version"
            )

    def hear(self, message: bytes, program: str, *, linked_ns: int) -> None:
        """Hand on a message as CDR, or as bytes that are none."""
        try:
            cdr = self._wire.cdr(message)
        except MessageError:
            cdr = _NO_MESSAGE + message
        self._take(cdr, program, linked_ns=linked_ns)


class _Link:
    """Between a topic of ours and a program that publishes it."""

    def __init__(self, subscription: Subscription, *, there_before: bool) -> None:
        """Take the topic; `there_before`: what the program has kept of it is older than the link."""
        self.subscription, self.there_before = subscription, there_before
        self.connection: Connection | None = None
        self.wanted = True
        """Whether the master says that the program publishes it."""
        self.due, self.delay = 0.0, 0.0

    def retry(self) -> None:
        """Have the connection made again, later each time that it fails."""
        # what the program has kept by then was heard, or could not be told while it was meant
        self.connection, self.there_before = None, True
        self.delay = min(max(2 * self.delay, _SOONEST_S), _LATEST_S)
        self.due = monotonic() + self.delay

    def greeted(self, connection: Connection, fields: Fields) -> Incoming:
        """Take the header of the publisher."""
        self.subscription.check(fields)
        self.delay = 0.0
        keeps = self.there_before and fields.get("latching") == "1"
        kept_until, linked_ns = monotonic() + _KEPT_S, time_ns()

        def heard(message: bytes) -> None:
            nonlocal keeps
            maybe_kept, keeps = keeps and monotonic() < kept_until, False
            self.subscription.hear(message, connection.program, linked_ns=linked_ns if maybe_kept else 0)

        return heard


class Subscriptions:
    """All topics.

    Each program that publishes any of them has a thread that connects to it, so that one that does not answer
    holds up no other.
    """

    def __init__(self, loop: Loop, node: str) -> None:
        """Take what watches the connections, and the name of our node."""
        self._loop, self._node = loop, node
        self._subscriptions: dict[str, Subscription] = {}
        self._listed: set[str] = set()
        """Topics of which a master has told who published them before us."""
        self._links: dict[str, dict[str, _Link]] = {}
        """By address of the program and topic."""
        self._changing = threading.Condition()
        self._closed = False

    @property
    def topics(self) -> list[list[str]]:
        """Names and types."""
        return [
            [topic, subscription.header["type"]] for topic, subscription in self._subscriptions.copy().items()
        ]

    @property
    def connections(self) -> list[tuple[str, Connection]]:
        """Topics with the connections to their publishers."""
        with self._changing:
            found = [
                (link.subscription.topic, link.connection)
                for links in self._links.values()
                for link in links.values()
            ]
        return [
            (topic, connection)
            for topic, connection in found
            if connection is not None and connection.is_greeted
        ]

    def add(self, subscription: Subscription) -> None:
        """Listen to a topic, once its publishers are known."""
        self._subscriptions[subscription.topic] = subscription

    def update(self, topic: str, uris: Iterable[str], *, there_before: bool) -> None:
        """Take the addresses of all programs that publish a topic; `there_before`: it is a master's answer to
        our registration, so they did before we listened.

        Of whom it tells before that, it is not known. One that is not among them and still connected is heard
        until it goes: a master that has started again knows nobody.
        """
        subscription, publishing = self._subscriptions.get(topic), set(uris)
        if subscription is None:
            return
        with self._changing:
            if there_before:
                self._listed.add(topic)
            kept_before = there_before or topic not in self._listed
            for uri in sorted(publishing):
                links = self._links.get(uri)
                if links is None and not self._closed:
                    links = self._links[uri] = {}
                    threading.Thread(
                        target=self._connect_all, args=(uri,), name=f"ROS 1 {uri}", daemon=True
                    ).start()
                if links is not None:
                    links.setdefault(topic, _Link(subscription, there_before=kept_before))
            for uri, links in self._links.items():
                if topic in links:
                    links[topic].wanted = uri in publishing
            self._changing.notify_all()

    def _connect_all(self, uri: str) -> None:
        """Keep the links to one program connected, as long as there are any."""
        program, links, told = Program(uri, self._node), self._links[uri], False
        try:
            while (link := self._due(uri, links)) is not None:
                try:
                    self._connect(program, link)
                except (OSError, DeviceError, ValueError) as error:
                    # it has ended without a word to the master
                    is_gone = isinstance(error.__cause__ or error, ConnectionRefusedError)
                    log.log(
                        logging.DEBUG if is_gone or told else logging.WARNING,
                        _UNREACHED,
                        uri,
                        link.subscription.topic,
                        error,
                    )
                    told = told or not is_gone
                    with self._changing:
                        link.retry()
        finally:
            program.close()

    def _due(self, uri: str, links: dict[str, _Link]) -> _Link | None:
        """Wait for a link that is to be connected now; None when there are no links any more."""
        with self._changing:
            while not self._closed:
                for topic in [
                    topic for topic, link in links.items() if link.connection is None and not link.wanted
                ]:
                    del links[topic]
                if not links:
                    break
                missing = [link for link in links.values() if link.connection is None]
                first = min(missing, key=lambda link: link.due, default=None)
                if first is not None and first.due <= monotonic():
                    return first
                self._changing.wait(None if first is None else first.due - monotonic())
            del self._links[uri]
            return None

    def _connect(self, program: Program, link: _Link) -> None:
        """Connect to a topic of a program.

        Raises OSError, DeviceError, or of a host's name that is none ValueError, if that cannot be.
        """
        answer = program.call("requestTopic", link.subscription.topic, [["TCPROS"]])
        match answer:
            case (1, _, [_, str(host), int(port)]) if 0 < port < 1 << 16:
                sock = socket.create_connection((host, port), _CONNECT_S)
            case _:
                raise DeviceError(f"it names no place to connect to: {answer}")
        try:
            with self._changing:
                self._begin(link, sock)
        except OSError:  # gone already
            sock.close()
            raise

    def _begin(self, link: _Link, sock: socket.socket) -> None:
        if self._closed:
            sock.close()
            return
        link.connection = connection = Connection(self._loop, sock, link.greeted, partial(self._lost, link))
        connection.send(header_frame(link.subscription.header))
        connection.start()

    def _lost(self, link: _Link, _: Connection) -> None:
        with self._changing:
            link.retry()
            self._changing.notify_all()

    def close(self) -> None:
        """Connect no more; connections that are there end with their loop."""
        with self._changing:
            self._closed = True
            self._changing.notify_all()
