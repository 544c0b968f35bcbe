"""What a gateway needs of a middleware. A gateway for another one is another transport.

Everything that crosses here is CDR, little-endian, with its encapsulation header, whatever the middleware has
on its own wire.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from devices.ros.topics.row import Row

__all__ = ["NODE", "Client", "Handler", "Publisher", "Taker", "Transport"]

NODE = "/dvrk"
"""Name of the node of ROS 2 that all belongs to, as on the real one: jhu-dvrk/sawIntuitiveResearchKit,
ros/dvrk_robot/src/dvrk_system.cpp (commit 47bb09f7).
"""

Publisher = Callable[[bytes], None]
"""Sends one message (CDR). Never blocks: where a reader does not keep up, older messages are dropped for it.

One thread at a time per publisher.
"""


class Taker(Protocol):
    """Takes messages of one topic. Never raises, never blocks; may be called from any thread."""

    def __call__(self, payload: bytes, client: str, /, *, linked_ns: int = 0) -> None:
        """Take one message (CDR) and the name of the client that sent it.

        `linked_ns`: wall time at which the client was connected, where this may be a message from before that
        the client has kept; else 0.
        """
        ...


Handler = Callable[[bytes], bytes]
"""Takes a request and returns the response (both CDR).

Raises MessageError if the bytes are no such request: then there is no response.
"""


@dataclass(frozen=True, slots=True)
class Client:
    """A program at the other side, as its middleware knows it."""

    name: str
    """The same that a `Taker` is given: one for all publishers of a program, different for two programs, such
    as `/console`.
    """
    address: str = ""
    """Where it runs, or an id of the middleware; empty where that is not known."""


class Transport(ABC):
    """Publishers, subscribers and services of one ROS graph."""

    @abstractmethod
    def advertise(self, row: Row) -> Publisher:
        """Begin to publish `row.topic`, reliable; late joiners get the last message of a latched row (ROS 2:
        transient local, depth 1).
        """

    @abstractmethod
    def subscribe(self, row: Row, take: Taker) -> None:
        """Begin to listen to `row.topic`, reliable and volatile: only what is sent from now on, in order,
        nothing dropped up to 10 messages.
        """

    @abstractmethod
    def serve(self, row: Row, handle: Handler) -> None:
        """Begin to answer the service `row.topic` of type `row.type` (`crtk_msgs/srv/...`)."""

    @abstractmethod
    def clients(self) -> tuple[Client, ...]:
        """Return the programs that read or write any of our topics now, without ourselves.

        Cheap: it is asked once a second.
        """

    @abstractmethod
    def close(self) -> None:
        """Leave the graph. May be called twice."""
