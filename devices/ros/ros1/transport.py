"""A ROS 1 node on Python's standard library: no ROS is needed where the hub runs.

Source: wiki.ros.org/ROS/Technical Overview.
"""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Callable
from functools import partial
from typing import Any

from devices.ros.ros1.connection import Connection, Fields, FrameHandler, header_frame
from devices.ros.ros1.event_loop import EventLoop
from devices.ros.ros1.listener import Listener
from devices.ros.ros1.publication import Publication
from devices.ros.ros1.registration import Entry, Registration
from devices.ros.ros1.service import Service
from devices.ros.ros1.subscription import Subscription, Subscriptions
from devices.ros.ros1.types import ros1_name
from devices.ros.ros1.xmlrpc_api import ApiResult, ApiServer, success
from devices.ros.topics.row import Row
from devices.ros.transport import Client, MessageHandler, Publisher, ServiceHandler, Transport
from schemas.errors import MessageError

__all__ = ["Ros1Transport"]

log = logging.getLogger(__name__)


class Ros1Transport(Transport):
    """Publishes, subscribes and serves as one node, registered as soon as the master answers."""

    def __init__(self, master: str, node: str, host: str) -> None:
        """Start the node.

        Args:
            master: URI of the master, `http://host:port`.
            node: name of the node.
            host: address of this machine for programs.
        """
        self._node, self._host, self._master = node, host, master
        self.endpoint = f"ROS_MASTER_URI={master}"
        self._publications: dict[str, Publication] = {}
        self._services: dict[str, Service] = {}
        self._connections: dict[Connection, Publication | None] = {}
        """Connections of programs to us after the header, with their publication; None: a service."""
        self._closed = False
        self._server = ApiServer(host, self._slave_methods())
        self._loop = EventLoop(f"ROS 1 {node}")
        self._subscriptions = Subscriptions(self._loop, node)
        self._listener = Listener(self._loop, host, self._on_connection)
        self._registration = Registration(master, node, self._server.uri)

    def advertise(self, row: Row) -> Publisher:  # noqa: D102
        publication = self._publications[row.topic] = Publication(row, self._node)
        self._registration.add(Entry("Publisher", row.topic, (ros1_name(row.type),)))
        return publication

    def subscribe(self, row: Row, receive: MessageHandler) -> None:  # noqa: D102
        self._subscriptions.add(Subscription(row, receive, self._node))
        on_registered = partial(self._subscriptions.update, row.topic, published_before=True)
        self._registration.add(Entry("Subscriber", row.topic, (ros1_name(row.type),), on_registered))

    def serve(self, row: Row, handle: ServiceHandler) -> None:  # noqa: D102
        self._services[row.topic] = Service(row, handle, self._node)
        self._registration.add(Entry("Service", row.topic, (f"rosrpc://{self._host}:{self._listener.port}",)))

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

    def _on_connection(self, sock: socket.socket) -> None:
        Connection(self._loop, sock, self._on_header, self._on_closed).start()

    def _on_header(self, connection: Connection, fields: Fields) -> FrameHandler:
        """Accept a subscriber of a topic, or a client of a service."""
        topic, service = fields.get("topic", ""), fields.get("service", "")
        publication = self._publications.get(topic)
        target = publication or self._services.get(service)
        try:
            if target is None:
                raise MessageError(
                    f"'{self._node}' has no topic or service '{topic or service}' for others to connect to"
                )
            on_frame = target.on_header(connection, fields)
        except MessageError as error:
            connection.send(header_frame({"error": str(error)}))
            raise
        self._connections[connection] = publication
        self.changed()
        return on_frame

    def _on_closed(self, connection: Connection) -> None:
        publication = self._connections.pop(connection, None)
        if publication is not None:
            publication.remove(connection)
            self.changed()

    def _slave_methods(self) -> dict[str, Callable[..., ApiResult]]:
        """Return the methods of the Slave API; the first argument of each is the caller's id."""
        return {
            "getBusInfo": _value_getter(self._bus_info),
            "getBusStats": _value_getter(lambda: ((), (), ())),
            "getMasterUri": _value_getter(lambda: self._master),
            "getPid": _value_getter(os.getpid),
            "getPublications": _value_getter(
                lambda: [[each.topic, each.type] for each in tuple(self._publications.values())]
            ),
            "getSubscriptions": _value_getter(lambda: self._subscriptions.topics),
            "paramUpdate": lambda *_: success(),
            "publisherUpdate": self._publisher_update,
            "requestTopic": self._request_topic,
            "shutdown": self._shut_down,
        }

    def _bus_info(self) -> list[list[Any]]:
        """Return our connections in the form of `rosnode info`."""
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

    def _publisher_update(self, _: str, topic: str, uris: list[str]) -> ApiResult:
        self._subscriptions.update(topic, uris, published_before=False)
        return success()

    def _request_topic(self, _: str, topic: str, protocols: list[list[Any]]) -> ApiResult:
        if topic not in self._publications:
            return ApiResult(0, f"'{self._node}' does not publish '{topic}'", 0)
        if ["TCPROS"] not in [protocol[:1] for protocol in protocols]:
            return ApiResult(0, f"'{self._node}' supports TCPROS only", 0)
        self.note_newcomer()  # it may read a state as soon as it has connected
        return success(["TCPROS", self._host, self._listener.port])

    def _shut_down(self, caller: str, reason: str = "") -> ApiResult:
        log.warning(
            "ROS 1: '%s' requests '%s' to end (%s), which ends with its session only",
            caller,
            self._node,
            reason,
        )
        return success()


def _value_getter(value: Callable[[], object]) -> Callable[[str], ApiResult]:
    """Return a method without arguments returning `value()`."""

    def get(_caller: str) -> ApiResult:
        return success(value())

    return get
