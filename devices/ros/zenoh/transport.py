"""ROS 2 in the layout of rmw_zenoh, on the router of a hub."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from contextlib import ExitStack
from time import time_ns

import zenoh
from zenoh import ext
from zenoh.handlers import Callback, RingChannel

from devices.ros.topics.row import Row
from devices.ros.transport import NODE, Client, MessageHandler, Publisher, ServiceHandler, Transport
from devices.ros.zenoh.early_messages import EarlyMessages
from devices.ros.zenoh.graph import Graph, gid_of
from devices.ros.zenoh.layout import (
    LATCHED,
    VOLATILE,
    Attachment,
    EntityKind,
    GraphToken,
    graph_key,
    key,
    packed_attachment,
    ready_key,
    type_hash,
)
from schemas.errors import MessageError

__all__ = ["ZenohTransport"]

log = logging.getLogger(__name__)

_HEARTBEAT_S = 0.5
"""Period of a latched publisher's repetition of the last message's number, for subscribers to detect a loss:
rmw_zenoh's period. rmw_zenoh sends the number once per message and blocks until every reader has received the
number; we send periodically, because a program no longer reading must not block the others.
"""


class _Publisher:
    """Numbers the messages of a topic, and knows whether a program subscribes.

    Changes are looked up: a callback waits for Python's lock in a thread of Zenoh, and `undeclare` of a
    latched publisher holds the lock until that thread has time.
    """

    def __init__(
        self, publisher: zenoh.Publisher | ext.AdvancedPublisher, gid: bytes, changed: Callable[[], None]
    ) -> None:
        self._publisher, self._gid, self._sequence, self._changed = publisher, gid, 0, changed
        self._lock = threading.Lock()
        self._closed, self._wanted, self._changes = False, True, None
        if isinstance(publisher, zenoh.Publisher):
            self._changes = publisher.declare_matching_listener(RingChannel(1))
            self._wanted = publisher.matching_status.matching

    @property
    def wanted(self) -> bool:
        """Whether a program subscribes, or may."""
        if self._changes is None:
            return True
        with self._lock:
            status = None if self._closed else self._changes.try_recv()
            if status is None or status.matching == self._wanted:
                return self._wanted
            self._wanted = status.matching
        self._changed()
        return self._wanted

    def __call__(self, message: bytes) -> None:
        with self._lock:  # Zenoh's publisher is borrowed during a put: `undeclare` would raise
            if not self._closed:
                self._sequence += 1
                self._publisher.put(
                    message, attachment=packed_attachment(self._sequence, time_ns(), self._gid)
                )

    def undeclare(self) -> None:
        """Publish no more."""
        with self._lock:
            self._closed = True
            if self._changes is not None:
                self._changes.undeclare()
            self._publisher.undeclare()


class ZenohTransport(Transport):
    """Publishes, listens and answers under rmw_zenoh's keys, as one node of a gateway or of a program.

    A gateway's publishing never waits for a reader: messages unread by a program are dropped for this
    program, and the program queries the last message of a latched topic again. States and events have
    separate queues, and pictures a session of their own: for a program not reading, the router tries for
    50 ms before dropping the rest of a picture, and reads nothing else of the session meanwhile.
    """

    def __init__(
        self,
        connect: Callable[[], zenoh.Session],
        domain: int,
        *,
        node: str = NODE,
        congestion: zenoh.CongestionControl = zenoh.CongestionControl.DROP,
    ) -> None:
        """Join the graph.

        Args:
            connect: opens a Zenoh session.
            domain: the ROS domain.
            node: name of the node.
            congestion: how messages are sent while the router is busy.
        """
        self.endpoint = f"ROS_DOMAIN_ID={domain}"
        self._session = connect()
        self._connect_pictures, self._pictures = connect, None
        self._node, self._congestion = node, congestion
        self._domain, self._id = domain, str(self._session.zid())
        self._graph = Graph(self._id)
        self._early = EarlyMessages(self._graph)
        self._topics: set[str] = set()
        self._entities: list[
            _Publisher
            | zenoh.Subscriber[None]
            | ext.AdvancedSubscriber
            | zenoh.Queryable[None]
            | zenoh.LivelinessToken
        ] = []
        self._number = 0
        self._closed = False
        watch = Callback(self._token_changed, indirect=True)  # as in `_Publisher`: not in Zenoh's thread
        liveliness = self._session.liveliness()
        self._entities.append(liveliness.declare_subscriber(graph_key(domain), watch, history=True))
        self._entities.append(liveliness.declare_token(GraphToken(self._id, 0, "NN", node).key(domain)))

    def advertise(self, row: Row) -> Publisher:  # noqa: D102
        address, cdr = key(self._domain, row.topic, row.type), zenoh.Encoding.APPLICATION_CDR
        priority = zenoh.Priority.REAL_TIME if row.periodic else zenoh.Priority.INTERACTIVE_HIGH
        if row.latched:
            publisher = ext.declare_advanced_publisher(
                self._session,
                address,
                encoding=cdr,
                congestion_control=self._congestion,
                priority=priority,
                cache=ext.CacheConfig(max_samples=1),
                sample_miss_detection=ext.MissDetectionConfig(heartbeat=_HEARTBEAT_S),
                publisher_detection=True,
            )
        else:
            session = self._session_of_pictures() if row.is_picture else self._session
            publisher = session.declare_publisher(
                address, encoding=cdr, congestion_control=self._congestion, priority=priority
            )
        gid = gid_of(self._announce_entity("MP", row, LATCHED if row.latched else VOLATILE))
        advertised = _Publisher(publisher, gid, lambda: self.changed())
        self._entities.append(advertised)
        return advertised

    def _session_of_pictures(self) -> zenoh.Session:
        if self._pictures is None:
            self._pictures = self._connect_pictures()
        return self._pictures

    def subscribe(self, row: Row, receive: MessageHandler) -> None:  # noqa: D102
        topic = row.topic

        def on_sample(sample: zenoh.Sample) -> None:
            try:
                attached = Attachment.unpack(
                    b"" if sample.attachment is None else sample.attachment.to_bytes()
                )
            except MessageError as error:
                log.warning("%s: a message is dropped: %s", topic, error)
                return
            self._early.receive(topic, attached.gid, sample.payload.to_bytes(), receive)

        address, callback = key(self._domain, topic, row.type), Callback(on_sample, indirect=False)
        if row.latched:
            subscriber = ext.declare_advanced_subscriber(
                self._session,
                address,
                callback,
                history=ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
                recovery=ext.RecoveryConfig(heartbeat=True),
            )
        else:
            subscriber = self._session.declare_subscriber(address, callback)
        self._entities.append(subscriber)
        self._announce_entity("MS", row, LATCHED if row.latched else VOLATILE)

    def serve(self, row: Row, handle: ServiceHandler) -> None:  # noqa: D102
        address = key(self._domain, row.topic, row.type)

        def on_query(query: zenoh.Query) -> None:
            with query:
                request, attachment = query.payload, query.attachment
                try:
                    attached = Attachment.unpack(b"" if attachment is None else attachment.to_bytes())
                    response = handle(b"" if request is None else request.to_bytes())
                except MessageError as error:
                    query.reply_err(f"{row.topic}: {error}")
                    return
                returned = Attachment(attached.sequence, time_ns(), attached.gid).pack()
                query.reply(address, response, encoding=zenoh.Encoding.APPLICATION_CDR, attachment=returned)

        self._entities.append(
            self._session.declare_queryable(address, Callback(on_query, indirect=True), complete=True)
        )
        self._announce_entity("SS", row, VOLATILE)

    def clients(self) -> tuple[Client, ...]:  # noqa: D102
        return self._graph.clients(self._topics)

    def announce_ready(self) -> None:  # noqa: D102
        token = ready_key(self._domain, self._id, self._number)
        self._entities.append(self._session.liveliness().declare_token(token))

    def present_name(self, client: str) -> str | None:  # noqa: D102
        return self._graph.present_name(client)

    def close(self) -> None:  # noqa: D102
        if not self._closed:
            self._closed = True
            with ExitStack() as last_first:  # each part is closed, whatever another one raises
                if self._pictures is not None:
                    last_first.callback(self._pictures.close)
                last_first.callback(self._early.close)
                last_first.callback(self._session.close)
                for entity in reversed(self._entities):
                    last_first.callback(entity.undeclare)

    def _announce_entity(self, kind: EntityKind, row: Row, quality: str) -> str:
        """Declare the liveliness token of a publisher, subscriber or server; return the token's key."""
        self._number += 1
        self._topics.add(row.topic)
        token = GraphToken(
            self._id, self._number, kind, self._node, row.topic, row.type, type_hash(row.type), quality
        ).key(self._domain)
        self._entities.append(self._session.liveliness().declare_token(token))
        return token

    def _token_changed(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.DELETE:
            self._graph.remove(str(sample.key_expr))
        else:
            if self._graph.add(str(sample.key_expr)):
                self.note_newcomer()
            self._early.note_token()
