"""A node of ROS 1 in Python's standard library: nothing of ROS is needed where the hub runs.

Source: wiki.ros.org/ROS/Technical Overview.
"""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Callable
from functools import partial
from typing import Any

from devices.ros.ros1.api import Answer, ProgramServer, said
from devices.ros.ros1.connection import Connection, Fields, Incoming, header_frame
from devices.ros.ros1.listener import Listener
from devices.ros.ros1.loop import Loop
from devices.ros.ros1.publication import Publication
from devices.ros.ros1.registration import Registration, Thing
from devices.ros.ros1.service import Service
from devices.ros.ros1.subscription import Subscription, Subscriptions
from devices.ros.ros1.types import ros1_name
from devices.ros.topics.row import Row
from devices.ros.transport import Client, Handler, Publisher, Taker, Transport
from schemas.errors import MessageError

__all__ = ["Ros1Transport"]

log = logging.getLogger(__name__)


class Ros1Transport(Transport):
    """Publishes, listens and answers as one node, at one address, which it tells a master as soon as there is
    one.
    """

    def __init__(self, master: str, node: str, host: str) -> None:
        """Take the master's address, `http://host:port`, the node's name, and the address of this machine at
        which programs reach it.
        """
        self._node, self._host, self._master = node, host, master
        self._publications: dict[str, Publication] = {}
        self._services: dict[str, Service] = {}
        self._connections: dict[Connection, Publication | None] = {}
        """All that others have made to us, once their headers have come; None: to ask a service."""
        self._closed = False
        self._server = ProgramServer(host, self._methods())
        self._loop = Loop(f"ROS 1 {node}")
        self._subscriptions = Subscriptions(self._loop, node)
        self._listener = Listener(self._loop, host, self._came)
        self._registration = Registration(master, node, self._server.uri)

    def advertise(self, row: Row) -> Publisher:  # noqa: D102
        publication = self._publications[row.topic] = Publication(row, self._node)
        self._registration.add(Thing("Publisher", row.topic, (ros1_name(row.type),)))
        return publication.publish

    def subscribe(self, row: Row, take: Taker) -> None:  # noqa: D102
        self._subscriptions.add(Subscription(row, take, self._node))
        told = partial(self._subscriptions.update, row.topic, there_before=True)
        self._registration.add(Thing("Subscriber", row.topic, (ros1_name(row.type),), told))

    def serve(self, row: Row, handle: Handler) -> None:  # noqa: D102
        self._services[row.topic] = Service(row, handle, self._node)
        self._registration.add(Thing("Service", row.topic, (f"rosrpc://{self._host}:{self._listener.port}",)))

    def clients(self) -> tuple[Client, ...]:  # noqa: D102
        connections = (
            *self._connections.copy(),
            *(connection for _, connection in self._subscriptions.connections),
        )
        return tuple(
            Client(name, address)
            for name, address in {each.program: each.address for each in connections}.items()
        )

    def close(self) -> None:  # noqa: D102
        if self._closed:
            return
        self._closed = True
        self._registration.close()
        self._server.close()
        self._subscriptions.close()
        self._loop.close()

    def _came(self, sock: socket.socket) -> None:
        """Take a program that has connected."""
        Connection(self._loop, sock, self._greeted, self._lost).start()

    def _greeted(self, connection: Connection, fields: Fields) -> Incoming:
        """Take its header: it listens to a topic or asks a service."""
        topic, service = fields.get("topic", ""), fields.get("service", "")
        publication = self._publications.get(topic)
        answering = publication or self._services.get(service)
        try:
            if answering is None:
                raise MessageError(
                    f"'{self._node}' has no topic or service '{topic or service}' for others to connect to"
                )
            takes = answering.greet(connection, fields)
        except MessageError as error:
            connection.send(header_frame({"error": str(error)}))
            raise
        self._connections[connection] = publication
        return takes

    def _lost(self, connection: Connection) -> None:
        publication = self._connections.pop(connection, None)
        if publication is not None:
            publication.part(connection)

    def _methods(self) -> dict[str, Callable[..., Answer]]:
        """Return what others may call; each is given the caller's name first."""
        return {
            "getBusInfo": _telling(self._bus),
            "getBusStats": _telling(lambda: ((), (), ())),
            "getMasterUri": _telling(lambda: self._master),
            "getPid": _telling(os.getpid),
            "getPublications": _telling(
                lambda: [[each.topic, each.type] for each in tuple(self._publications.values())]
            ),
            "getSubscriptions": _telling(lambda: self._subscriptions.topics),
            "paramUpdate": lambda *_: said(),
            "publisherUpdate": self._publisher_update,
            "requestTopic": self._request_topic,
            "shutdown": self._shut_down,
        }

    def _bus(self) -> list[list[Any]]:
        """Return our connections as `rosnode info` shows them."""
        readers = [
            (reader.program, "o", publication.topic)
            for reader, publication in self._connections.copy().items()
            if publication is not None
        ]
        writers = [(writer.program, "i", topic) for topic, writer in self._subscriptions.connections]
        return [
            [index, program, way, "TCPROS", topic, True]
            for index, (program, way, topic) in enumerate(readers + writers)
        ]

    def _publisher_update(self, _: str, topic: str, uris: list[str]) -> Answer:
        self._subscriptions.update(topic, uris, there_before=False)
        return said()

    def _request_topic(self, _: str, topic: str, protocols: list[list[Any]]) -> Answer:
        if topic not in self._publications:
            return Answer(0, f"'{self._node}' does not publish '{topic}'", 0)
        if ["TCPROS"] not in [protocol[:1] for protocol in protocols]:
            return Answer(0, f"'{self._node}' speaks TCPROS only", 0)
        return said(["TCPROS", self._host, self._listener.port])

    def _shut_down(self, caller: str, reason: str = "") -> Answer:
        log.warning(
            "ROS 1: '%s' asks '%s' to end (%s); it does when its session does", caller, self._node, reason
        )
        return said()


def _telling(value: Callable[[], object]) -> Callable[[str], Answer]:
    """Return a method of no arguments that tells a value."""

    def tell(_caller: str) -> Answer:
        return said(value())

    return tell
