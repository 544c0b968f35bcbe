"""Topics subscribed to by our ROS 1 node, and connections to their publishers."""

from __future__ import annotations

import logging
import socket
import threading
from collections.abc import Iterable
from functools import partial
from http.client import HTTPException
from time import monotonic, time_ns

from devices.ros.ros1.connection import Connection, Fields, FrameHandler, header_frame
from devices.ros.ros1.event_loop import EventLoop
from devices.ros.ros1.types import Wire, checksum, definition, ros1_name
from devices.ros.ros1.xmlrpc_api import ApiClient
from devices.ros.topics.row import Row
from devices.ros.transport import MessageHandler
from schemas.errors import DeviceError, MessageError

__all__ = ["Subscription", "Subscriptions"]

log = logging.getLogger(__name__)

_CONNECT_S = 2.0
_FIRST_RETRY_S, _LAST_RETRY_S = 0.5, 30.0
"""Shortest and longest time until a failed connection is tried again; as in rospy."""
_LATCHED_S = 0.5
"""Latest arrival of a latched message after the publisher's header, s: a few milliseconds, some tens on a
busy machine. A message with a later arrival was published now.
"""
_UNREACHED = "ROS 1: the program at %s, which publishes %s, cannot be reached: %s%s"
_ADDRESS_HINT = ". Its ROS_IP or ROS_HOSTNAME must be an address that this machine can resolve"
_INVALID = b"\xff\xff"
"""Prefix of bytes without a conversion to CDR; CDR cannot begin with this prefix."""


class Subscription:
    """A topic, and the handler of its messages."""

    def __init__(self, row: Row, receive: MessageHandler, node: str) -> None:
        """`node`: name of our node."""
        self.topic, self._receive, self._wire = row.topic, receive, Wire(row.type)
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
        """Raise MessageError if a publisher's header reports an error or another type."""
        if "error" in fields:
            raise MessageError(f"{self.topic}: {fields['error']}")
        if fields.get("md5sum", "*") not in (self._md5, "*"):
            raise MessageError(
                f"{self.topic} has MD5 {self._md5}, not {fields['md5sum']}: the publisher has another version"
                " of the message"
            )

    def on_message(self, message: bytes, program: str, *, connected_ns: int) -> None:
        """Pass on a message as CDR, or as invalid bytes for the receiver to count and report."""
        try:
            cdr = self._wire.cdr(message)
        except MessageError:
            cdr = _INVALID + message
        self._receive(cdr, program, connected_ns=connected_ns)


class _PublisherLink:
    """Our subscription to a topic at a single publisher."""

    def __init__(self, subscription: Subscription, *, published_before: bool) -> None:
        """`published_before`: a latched message of the publisher is older than the connection."""
        self.subscription, self.published_before = subscription, published_before
        self.connection: Connection | None = None
        self.wanted = True
        """Whether the program publishes the topic, as reported by the master."""
        self.due, self.delay = 0.0, 0.0

    def retry(self) -> None:
        """Schedule the next attempt to connect, later after each failure."""
        # a latched message at the next connection was received already, or is too old to be meant
        self.connection, self.published_before = None, True
        self.delay = min(max(2 * self.delay, _FIRST_RETRY_S), _LAST_RETRY_S)
        self.due = monotonic() + self.delay

    def on_header(self, connection: Connection, fields: Fields) -> FrameHandler:
        """Accept the publisher's header. Raises MessageError for a header of another topic."""
        self.subscription.check(fields)
        self.delay = 0.0
        is_first = self.published_before and fields.get("latching") == "1"
        latched_until, connected_ns = monotonic() + _LATCHED_S, time_ns()

        def on_frame(message: bytes) -> None:
            nonlocal is_first
            may_be_latched, is_first = is_first and monotonic() < latched_until, False
            self.subscription.on_message(
                message, connection.program, connected_ns=connected_ns if may_be_latched else 0
            )

        return on_frame


class Subscriptions:
    """All subscribed topics.

    Each publishing program has a connecting thread, so a silent program delays no other.
    """

    def __init__(self, loop: EventLoop, node: str) -> None:
        """`loop` watches the connections; `node`: name of our node."""
        self._loop, self._node = loop, node
        self._subscriptions: dict[str, Subscription] = {}
        self._listed: set[str] = set()
        """Topics with earlier publishers listed in the master's answer to our registration."""
        self._links: dict[str, dict[str, _PublisherLink]] = {}
        """Links by URI of the program and topic."""
        self._changing = threading.Condition()
        self._closed = False

    @property
    def topics(self) -> list[list[str]]:
        """Names and ROS 1 types."""
        return [
            [topic, subscription.header["type"]] for topic, subscription in self._subscriptions.copy().items()
        ]

    @property
    def connections(self) -> list[tuple[str, Connection]]:
        """Topics with the established connections to their publishers."""
        with self._changing:
            found = [
                (link.subscription.topic, link.connection)
                for links in self._links.values()
                for link in links.values()
            ]
        return [
            (topic, connection)
            for topic, connection in found
            if connection is not None and connection.is_established
        ]

    def add(self, subscription: Subscription) -> None:
        """Subscribe to a topic; connections follow when publishers are known."""
        self._subscriptions[subscription.topic] = subscription

    def update(self, topic: str, uris: Iterable[str], *, published_before: bool) -> None:
        """Set the URIs of all programs publishing a topic.

        A connected publisher missing in `uris` keeps its connection: a restarted master knows no node.

        Args:
            topic: name of the topic.
            uris: URIs of the publishers' Slave APIs.
            published_before: whether the URIs are the master's answer to our registration, and the publishers
                therefore older than our subscription. Assumed for updates before the answer.
        """
        subscription, publishing = self._subscriptions.get(topic), set(uris)
        if subscription is None:
            return
        with self._changing:
            if published_before:
                self._listed.add(topic)
            is_older = published_before or topic not in self._listed
            for uri in sorted(publishing):
                links = self._links.get(uri)
                if links is None and not self._closed:
                    links = self._links[uri] = {}
                    threading.Thread(
                        target=self._connect_all, args=(uri,), name=f"ROS 1 {uri}", daemon=True
                    ).start()
                if links is not None:
                    links.setdefault(topic, _PublisherLink(subscription, published_before=is_older))
            for uri, links in self._links.items():
                if topic in links:
                    links[topic].wanted = uri in publishing
            self._changing.notify_all()

    def _connect_all(self, uri: str) -> None:
        """Keep the links to a program connected, as long as the program has links.

        Only a lasting failure is logged: an ended program is unknown to the master a moment later.
        """
        client, links, has_warned = ApiClient(uri, self._node), self._links[uri], False
        try:
            while (link := self._wait_for_due_link(uri, links)) is not None:
                try:
                    self._connect(client, link)
                except (OSError, DeviceError, ValueError) as error:
                    with self._changing:
                        may_be_ending = not link.wanted or not link.delay
                        link.retry()
                    if has_warned or may_be_ending or _has_ended(error):
                        log.debug(_UNREACHED, uri, link.subscription.topic, error, "")
                    else:
                        has_warned = True
                        log.warning(_UNREACHED, uri, link.subscription.topic, error, _connection_hint(error))
        finally:
            client.close()

    def _wait_for_due_link(self, uri: str, links: dict[str, _PublisherLink]) -> _PublisherLink | None:
        """Wait for a link due to be connected; None: the program has no links any more."""
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

    def _connect(self, client: ApiClient, link: _PublisherLink) -> None:
        """Connect to a topic of a program.

        Raises OSError or DeviceError on failure, ValueError for an invalid host name.
        """
        result = client.call("requestTopic", link.subscription.topic, [["TCPROS"]])
        match result:
            case (1, _, [_, str(host), int(port)]) if 0 < port < 1 << 16:
                sock = socket.create_connection((host, port), _CONNECT_S)
            case (0 | -1, reason, _):
                raise ConnectionRefusedError(
                    f"it does not publish {link.subscription.topic} any more: {reason}"
                )
            case _:
                raise DeviceError(f"it returns no address to connect to: {result}")
        try:
            with self._changing:
                self._open(link, sock)
        except OSError:  # closed by the other side already
            sock.close()
            raise

    def _open(self, link: _PublisherLink, sock: socket.socket) -> None:
        if self._closed:
            sock.close()
            return
        link.connection = connection = Connection(
            self._loop, sock, link.on_header, partial(self._on_closed, link)
        )
        connection.send(header_frame(link.subscription.header))
        connection.start()

    def _on_closed(self, link: _PublisherLink, _: Connection) -> None:
        with self._changing:
            link.retry()
            self._changing.notify_all()

    def close(self) -> None:
        """Stop connecting; open connections end with their loop."""
        with self._changing:
            self._closed = True
            self._changing.notify_all()


def _has_ended(error: Exception) -> bool:
    """Return whether a program has ended or is about to end: connections are refused or closed.

    A program may end without unregistering at the master.
    """
    return isinstance(error.__cause__ or error, ConnectionError | HTTPException)


def _connection_hint(error: Exception) -> str:
    """Return the remedy for an address leading nowhere; empty: the program answers, but wrongly."""
    return _ADDRESS_HINT if isinstance(error.__cause__ or error, OSError | ValueError) else ""
