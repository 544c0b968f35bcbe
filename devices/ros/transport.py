"""What a gateway needs of a middleware: a gateway for another middleware is another transport.

All payloads are CDR, little-endian, with their encapsulation header, whatever the middleware's own wire has.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from devices.ros.topics.row import Row

__all__ = ["NODE", "Client", "MessageHandler", "Publisher", "ServiceHandler", "Transport"]

NODE = "/dvrk"
"""Name of the node of ROS 2 that all topics belong to, as on the real system:
jhu-dvrk/sawIntuitiveResearchKit, ros/dvrk_robot/src/dvrk_system.cpp (commit 47bb09f7).
"""


class Publisher(Protocol):
    """Publishes the messages of one topic. For one thread at a time."""

    @property
    def wanted(self) -> bool:
        """Whether a program subscribes, or may; `Transport.changed` is called when this has changed.

        True for latched topics, whose last message is for those who come later.
        """
        ...

    def __call__(self, message: bytes, /) -> None:
        """Publish a message (CDR). Never blocks: for a reader that is too slow older ones are dropped."""
        ...


class MessageHandler(Protocol):
    """Receives the messages of one topic. Never raises, never blocks; may be called from any thread."""

    def __call__(self, payload: bytes, client: str, /, *, connected_ns: int = 0) -> None:
        """Receive one message.

        Args:
            payload: the message (CDR).
            client: name of the program that sent it.
            connected_ns: wall time at which the client was connected, where this may be an older message that
                the client has kept; else 0.
        """
        ...


ServiceHandler = Callable[[bytes], bytes]
"""Returns the response to a request (both CDR).

Raises MessageError if the bytes are no such request: then there is no response.
"""


@dataclass(frozen=True, slots=True)
class Client:
    """A program at the other side, as its middleware knows it."""

    name: str
    """As a `MessageHandler` gets it: `/console`.

    One for all publishers of a program, different for two programs.
    """
    address: str = ""
    """Where it runs, or an id of the middleware; empty where that is not known."""


class Transport(ABC):
    """Publishers, subscribers and services of one ROS graph."""

    changed: Callable[[], None] = staticmethod(lambda: None)
    """Is called, in any thread, when a publisher has become `wanted` or is so no longer."""

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
        """Return the programs that publish or subscribe to any of our topics now, without ourselves.

        Called once a second, so it must be cheap.
        """

    @abstractmethod
    def close(self) -> None:
        """Leave the graph. May be called twice."""
