"""Interface between a gateway and a middleware: another middleware is another transport.

All payloads are CDR, little-endian, with their encapsulation header, also where the middleware's own wire
differs.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from time import monotonic
from typing import Protocol

from devices.ros.topics.row import Row

__all__ = ["NODE", "Client", "MessageHandler", "Publisher", "ServiceHandler", "Transport"]

NODE = "/dvrk"
"""Name of the ROS 2 node of all topics, as on the real system:
jhu-dvrk/sawIntuitiveResearchKit, ros/dvrk_robot/src/dvrk_system.cpp (commit 47bb09f7).
"""


class Publisher(Protocol):
    """Publishes the messages of a topic. For one thread at a time."""

    @property
    def wanted(self) -> bool:
        """Whether a program subscribes, or may; `Transport.changed` is called after every change.

        A change may be noticed only here.

        True for latched topics: the last message is for later subscribers.
        """
        ...

    def __call__(self, message: bytes, /) -> None:
        """Publish a message (CDR). Never blocks: for a slow reader older messages are dropped."""
        ...


class MessageHandler(Protocol):
    """Receives the messages of a topic. Never raises, never blocks; may be called from any thread."""

    def __call__(self, payload: bytes, client: str, /, *, connected_ns: int = 0) -> None:
        """Receive a message.

        Args:
            payload: the message (CDR).
            client: name of the sending program.
            connected_ns: wall time of the client's connection, if the message may be an older message kept by
                the client; else 0.
        """
        ...


ServiceHandler = Callable[[bytes], bytes]
"""Returns the response to a request (both CDR).

Raises MessageError if the bytes are no such request: then there is no response.
"""


@dataclass(frozen=True, slots=True)
class Client:
    """A program at the far side, as known to the middleware."""

    name: str
    """Name as passed to a `MessageHandler`: `/console`.

    Common to all publishers of a program, different for two programs.
    """
    address: str = ""
    """Address of the program, or an id of the middleware; empty: unknown."""


class Transport(ABC):
    """Publishers, subscribers and services of a ROS graph."""

    changed: Callable[[], None] = staticmethod(lambda: None)
    """Is called, in any thread, when a publisher has become `wanted` or is so no longer, and by newcomers."""
    joined_s = -inf
    """When the last program joined the graph, by the monotonic clock (s)."""
    endpoint = ""
    """Where programs reach the graph, in words: a master, a domain."""

    @abstractmethod
    def advertise(self, row: Row) -> Publisher:
        """Start to publish `row.topic`, reliable.

        Late joiners get the last message of a latched row (ROS 2: transient local, depth 1).
        """

    @abstractmethod
    def subscribe(self, row: Row, receive: MessageHandler) -> None:
        """Subscribe to `row.topic`, reliable and volatile.

        `receive` gets the messages from now on, in order, none dropped up to 10 at once.
        """

    @abstractmethod
    def serve(self, row: Row, handle: ServiceHandler) -> None:
        """Offer the service `row.topic` of type `row.type` (`crtk_msgs/srv/...`)."""

    @abstractmethod
    def clients(self) -> tuple[Client, ...]:
        """Return the programs now publishing or subscribing to any of our topics, without ourselves.

        Called once a second: must be cheap.
        """

    def note_newcomer(self) -> None:
        """Note that a program joins; may be called from any thread."""
        self.joined_s = monotonic()
        self.changed()

    def announce_ready(self) -> None:  # noqa: B027 - a middleware may have no use for it
        """Note that all rows are advertised, subscribed to or served."""

    def present_name(self, client: str) -> str | None:
        """Return the present name of a program once named `client`; None: the program has left.

        A middleware without this knowledge returns the name.
        """
        return client

    @abstractmethod
    def close(self) -> None:
        """Leave the graph. May be called twice."""
