"""Services and subscriptions over DDS: an RTPS participant of our own, with its readers and writers.

Programs with rmw_fastrtps tell requests apart by inline QoS, which Cyclone DDS gives no access to; so
services need a participant of their own, of which programs see the servers and nothing else. It answers
programs with rmw_cyclonedds, too: of two servers they would use the first that they discover.
Subscriptions are here because a reader of Cyclone DDS loses what a writer sends before Cyclone DDS has
matched the two, and a program publishes as soon as its own side is matched (docs/decisions/0030).
"""

from __future__ import annotations

import logging
import os
import socket
import struct
import threading
from collections.abc import Callable, Sequence
from functools import partial
from time import monotonic

from devices.ros.dds.endpoints import ReceiveSample, Service, Subscription
from devices.ros.dds.participant_proxy import ParticipantProxy, require_room
from devices.ros.dds.responses import CYCLONE_DDS, FAST_DDS, ResponseTo
from devices.ros.dds.rtps import (
    AckNack,
    Data,
    FromWriter,
    Message,
    encode_data,
    encode_message,
    encode_string,
    parse_message,
)
from devices.ros.dds.rtps_discovery import (
    LEASE_S,
    MULTICAST_GROUP,
    PARTICIPANT,
    PUBLICATIONS_READER,
    PUBLICATIONS_WRITER,
    READER_NO_KEY,
    SPDP_READER,
    SPDP_WRITER,
    SUBSCRIPTIONS_READER,
    SUBSCRIPTIONS_WRITER,
    WRITER_NO_KEY,
    announced_endpoint,
    announced_participant,
    disposed_endpoint_id,
    endpoint_data,
    is_disposed,
    multicast_port,
    participant_data,
    participant_disposal,
    unicast_ports,
)
from devices.ros.dds.stateful import SendSubmessages, StatefulReader, StatefulWriter
from devices.ros.transport import ServiceHandler
from schemas.errors import MessageError

__all__ = ["ServiceParticipant"]

log = logging.getLogger(__name__)

_NO_VENDOR = b"\x00\x00"
"""The first two bytes of our GUID prefix."""
_ANNOUNCE_S, _FORGET_S = 1.0, 3600.0
"""How often we announce ourselves, and after how long a silent participant is forgotten: one that was
stopped for longer than its lease, as in a debugger, goes on with the sequence numbers that it knows.
"""
_MOST_PARTICIPANTS = 512
"""Of a domain: whatever is sent on it, memory is limited."""


class ServiceParticipant:
    """The services and subscriptions of one domain, with a socket and a thread of their own."""

    def __init__(self, domain: int, *, multicast: bool, hosts: Sequence[str]) -> None:
        """Start discovery of a domain.

        Args:
            domain: its number.
            multicast: whether to announce ourselves to the network.
            hosts: addresses of machines to announce ourselves to. If that is 127.0.0.1 alone, without
                multicast, the socket receives from this machine only.
        """
        self._gateway = b""
        is_local = not multicast and all(host == "127.0.0.1" for host in hosts)
        self._targets = [(host, port) for host in hosts for port in unicast_ports(domain)] + (
            [(MULTICAST_GROUP, multicast_port(domain))] if multicast else []
        )
        self._domain = domain
        self._guid_prefix = _NO_VENDOR + os.urandom(10)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1" if is_local else "", 0))
        self._host = "127.0.0.1" if is_local else _own_address(domain)
        self._services: list[Service] = []
        self._subscriptions: list[Subscription] = []
        self._proxies: dict[bytes, ParticipantProxy] = {}
        """By GUID prefix."""
        self._changing = threading.Lock()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="DDS services", daemon=True)
        self._thread.start()

    def ignore(self, guid: bytes) -> None:
        """Ignore the participant with this GUID: the same gateway's on Cyclone DDS, which has no clients."""
        with self._changing:
            self._gateway = guid[:12]
            self._proxies.pop(self._gateway, None)  # it may be discovered already

    def serve(self, topic: str, ros_type: str, handle: ServiceHandler) -> tuple[bytes, bytes]:
        """Offer a service.

        Args:
            topic: name of the service: `/PSM1/forward_kinematics`.
            ros_type: `crtk_msgs/srv/QueryForwardKinematics`.
            handle: returns the response to a request.

        Returns:
            GUIDs (16 bytes) of the reader of requests and of the writer of responses.
        """
        package, group, name = ros_type.split("/")
        key = self._next_key()
        service = Service(
            f"rq{topic}Request",
            f"rr{topic}Reply",
            f"{package}::{group}::dds_::{name}_",
            key + READER_NO_KEY,
            key + WRITER_NO_KEY,
            handle,
        )
        with self._changing:
            self._services.append(service)
            for proxy in self._proxies.values():
                self._announce_endpoints(proxy, service)
            self._match_publications()
        return self._guid_prefix + service.reader_id, self._guid_prefix + service.writer_id

    def subscribe(self, topic: str, ros_type: str, user_data: str, receive: ReceiveSample) -> bytes:
        """Subscribe to a topic, reliable and volatile.

        Every message of a writer that counts itself matched is received, once and in order, however early it
        is sent, as far as the writer's history reaches; one in fragments up to `fragments.MOST_BYTES`.

        Args:
            topic: name of the ROS topic: `/PSM1/state_command`.
            ros_type: `crtk_msgs/msg/StringStamped`.
            user_data: is announced with the reader.
            receive: is called with every message, in the thread of this participant.

        Returns:
            GUID (16 bytes) of the reader.
        """
        package, group, name = ros_type.split("/")
        subscription = Subscription(
            f"rt{topic}",
            f"{package}::{group}::dds_::{name}_",
            self._next_key() + READER_NO_KEY,
            user_data,
            receive,
        )
        with self._changing:
            self._subscriptions.append(subscription)
            for proxy in self._proxies.values():
                self._announce_subscription(proxy, subscription)
            self._match_publications()
        return self._guid_prefix + subscription.reader_id

    def matched_topics(self) -> set[str]:
        """Return the DDS topics of which a writer is matched with one of our readers."""
        with self._changing:
            ids = {reader.reader_id for proxy in self._proxies.values() for reader in proxy.readers.values()}
            return {
                subscription.topic for subscription in self._subscriptions if subscription.reader_id in ids
            }

    def _next_key(self) -> bytes:
        return struct.pack(">I", len(self._services) + len(self._subscriptions) + 1)[1:]

    def _match_publications(self) -> None:
        for prefix, proxy in self._proxies.items():
            for writer_id in proxy.publications:
                self._match_publication(prefix, writer_id)

    def _run(self) -> None:
        due = monotonic()
        while not self._ended.is_set():
            now = monotonic()
            if now >= due:
                due = now + _ANNOUNCE_S
                self._announce_participant(self._targets)
                self._maintain(now)
            self._socket.settimeout(max(due - monotonic(), 0.001))
            try:
                datagram, address = self._socket.recvfrom(65536)
            except OSError:  # nothing has arrived, or an earlier datagram did not reach its target
                continue
            try:
                self._receive(parse_message(datagram, self._guid_prefix), address[0])
            except (MessageError, struct.error) as error:
                log.debug("a datagram from %s is dropped: %s", address[0], error)
            # an unforeseen error must not end the service for other programs
            except Exception:
                log.exception("a datagram from %s makes services fail", address[0])

    def _maintain(self, now: float) -> None:
        """Forget silent participants, and send due HEARTBEATs to the others."""
        with self._changing:
            self._proxies = {
                prefix: proxy
                for prefix, proxy in self._proxies.items()
                if now - proxy.announced_s < _FORGET_S
            }
            for proxy in self._proxies.values():
                if now - proxy.announced_s < LEASE_S:
                    for writer in proxy.writers.values():
                        writer.send_heartbeat()

    def _receive(self, message: Message, host: str) -> None:
        prefix = message.guid_prefix
        if prefix[:2] not in (FAST_DDS, CYCLONE_DDS) or prefix == self._gateway:
            return
        with self._changing:
            for part in message.submessages:
                proxy = self._proxies.get(prefix)
                if isinstance(part, Data) and part.writer_id == SPDP_WRITER:
                    self._on_participant(prefix, part, host)
                elif proxy is None:
                    continue
                elif isinstance(part, AckNack):
                    if (writer := proxy.writers.get((part.writer_id, part.reader_id))) is not None:
                        writer.on_acknack(part)
                elif (reader := proxy.readers.get(part.writer_id)) is not None:
                    reader.receive(part)
                else:
                    self._on_unmatched(prefix, proxy, part)

    def _on_participant(self, prefix: bytes, announcement: Data, host: str) -> None:
        """SPDP: a participant announces itself, or its end."""
        if is_disposed(announcement):
            self._proxies.pop(prefix, None)
            return
        known = self._proxies.get(prefix)
        if known is not None:
            known.announced_s = monotonic()
            return
        if len(self._proxies) >= _MOST_PARTICIPANTS:
            raise MessageError(f"a participant of RTPS beside {_MOST_PARTICIPANTS} others is not answered")
        metatraffic, default = ((host, port) for port in announced_participant(announcement))
        proxy = self._proxies[prefix] = ParticipantProxy(metatraffic, default, monotonic())
        send = self._sender(prefix, metatraffic)
        proxy.readers[PUBLICATIONS_WRITER] = _matched_reader(
            send, prefix, PUBLICATIONS_READER, PUBLICATIONS_WRITER, partial(self._on_publication, prefix)
        )
        proxy.readers[SUBSCRIPTIONS_WRITER] = _matched_reader(
            send, prefix, SUBSCRIPTIONS_READER, SUBSCRIPTIONS_WRITER, partial(self._on_subscription, prefix)
        )
        for writer_id, reader_id in (
            (PUBLICATIONS_WRITER, PUBLICATIONS_READER),
            (SUBSCRIPTIONS_WRITER, SUBSCRIPTIONS_READER),
        ):
            proxy.writers[writer_id, reader_id] = StatefulWriter(send, writer_id, reader_id)
        self._announce_participant([metatraffic])
        for service in self._services:
            self._announce_endpoints(proxy, service)
        for subscription in self._subscriptions:
            self._announce_subscription(proxy, subscription)

    def _on_publication(self, prefix: bytes, announcement: Data) -> None:
        """SEDP: match a client's writer with a reader, or remove that."""
        proxy = self._proxies[prefix]
        if is_disposed(announcement):
            gone = disposed_endpoint_id(announcement)
            proxy.readers.pop(gone, None)
            proxy.publications.pop(gone, None)
            proxy.gone.append(gone)
            return
        topic, writer_id = announced_endpoint(announcement)
        require_room(proxy.publications)
        proxy.publications[writer_id] = topic
        self._match_publication(prefix, writer_id)

    def _match_publication(self, prefix: bytes, writer_id: bytes) -> None:
        """Match a writer with our reader of its topic, if there is one.

        A writer that is announced again keeps its reader, which knows what has been received.
        """
        proxy = self._proxies[prefix]
        found = self._reader_of(proxy.publications[writer_id], prefix)
        if found is not None and writer_id not in proxy.readers:
            self._match(prefix, proxy, writer_id, *found)

    def _on_unmatched(self, prefix: bytes, proxy: ParticipantProxy, part: FromWriter) -> None:
        """Match a writer that is not discovered yet with the reader that it addresses, or discover it now."""
        if part.writer_id in proxy.gone:
            return
        proxy.unmatched.append(part)
        for subscription in self._subscriptions:
            if subscription.reader_id == part.reader_id:
                deliver = partial(_on_message, subscription, prefix)
                self._match(prefix, proxy, part.writer_id, part.reader_id, deliver)
                return
        if prefix.startswith(FAST_DDS):
            proxy.readers[PUBLICATIONS_WRITER].request_heartbeat()

    def _match(
        self,
        prefix: bytes,
        proxy: ParticipantProxy,
        writer_id: bytes,
        reader_id: bytes,
        deliver: Callable[[Data], None],
    ) -> None:
        require_room(proxy.readers)
        send = self._sender(prefix, proxy.default)
        reader = proxy.readers[writer_id] = _matched_reader(send, prefix, reader_id, writer_id, deliver)
        for part in [part for part in proxy.unmatched if part.writer_id == writer_id]:
            reader.receive(part)

    def _reader_of(self, topic: bytes, prefix: bytes) -> tuple[bytes, Callable[[Data], None]] | None:
        """Return EntityId and handler of our reader of a topic, which is as a parameter has it."""
        for service in self._services:
            if topic.startswith(encode_string(service.request_topic)):
                return service.reader_id, partial(self._on_request, service, prefix)
        for subscription in self._subscriptions:
            if topic.startswith(encode_string(subscription.topic)):
                return subscription.reader_id, partial(_on_message, subscription, prefix)
        return None

    def _on_subscription(self, prefix: bytes, announcement: Data) -> None:
        """SEDP: match a client's reader of responses with a writer, or remove that."""
        proxy = self._proxies[prefix]
        if is_disposed(announcement):
            gone = disposed_endpoint_id(announcement)
            proxy.writers = {ids: writer for ids, writer in proxy.writers.items() if ids[1] != gone}
            return
        topic, reader_id = announced_endpoint(announcement)
        for service in self._services:
            if topic.startswith(encode_string(service.response_topic)):
                require_room(proxy.writers)
                proxy.writers[service.writer_id, reader_id] = StatefulWriter(
                    self._sender(prefix, proxy.default), service.writer_id, reader_id
                )
        early = tuple(proxy.early)
        proxy.early.clear()
        for service, request in early:
            self._on_request(service, prefix, request)

    def _on_request(self, service: Service, prefix: bytes, request: Data) -> None:
        """Send the response to a request, as soon as the reader of the client is discovered."""
        proxy, response = self._proxies[prefix], ResponseTo(request, prefix)
        writers = [writer for ids, writer in proxy.writers.items() if response.is_for(ids, service.writer_id)]
        if not writers:
            proxy.early.append((service, request))
            return
        try:
            content = service.handle(response.request)
        except MessageError as error:
            log.warning("%s: a request is not answered: %s", service.request_topic, error)
            return
        for writer in writers:
            writer.write(response.payload(content), response.inline_qos)

    def _announce_participant(self, targets: Sequence[tuple[str, int]]) -> None:
        """SPDP: announce ourselves."""
        payload = participant_data(self._guid_prefix, self._domain, self._host, self._socket.getsockname()[1])
        data = encode_data(SPDP_WRITER, SPDP_READER, 1, payload)
        self._send(encode_message(self._guid_prefix, bytes(12), [data]), targets)

    def _announce_endpoints(self, proxy: ParticipantProxy, service: Service) -> None:
        """SEDP: announce the reader of requests and the writer of responses."""
        for ids, entity_id, topic, type_ in (
            (
                (PUBLICATIONS_WRITER, PUBLICATIONS_READER),
                service.writer_id,
                service.response_topic,
                f"{service.type}Response_",
            ),
            (
                (SUBSCRIPTIONS_WRITER, SUBSCRIPTIONS_READER),
                service.reader_id,
                service.request_topic,
                f"{service.type}Request_",
            ),
        ):
            proxy.writers[ids].write(endpoint_data(self._guid_prefix, entity_id, topic, type_), {})

    def _announce_subscription(self, proxy: ParticipantProxy, subscription: Subscription) -> None:
        """SEDP: announce the reader of a topic."""
        announcement = endpoint_data(
            self._guid_prefix,
            subscription.reader_id,
            subscription.topic,
            subscription.type,
            subscription.user_data.encode(),
        )
        proxy.writers[SUBSCRIPTIONS_WRITER, SUBSCRIPTIONS_READER].write(announcement, {})

    def _sender(self, prefix: bytes, address: tuple[str, int]) -> SendSubmessages:
        return lambda submessages: self._send(
            encode_message(self._guid_prefix, prefix, submessages), [address]
        )

    def _send(self, datagram: bytes, targets: Sequence[tuple[str, int]]) -> None:
        for target in targets:
            try:
                self._socket.sendto(datagram, target)
            except OSError as error:  # the other targets may be reachable
                log.debug("nothing can be sent to %s: %s", target, error)

    def close(self) -> None:
        """Leave the domain. May be called twice."""
        if not self._ended.is_set():
            self._ended.set()
            self._thread.join(timeout=2.0)
            data = encode_data(SPDP_WRITER, SPDP_READER, 2, b"", participant_disposal(self._guid_prefix))
            self._send(
                encode_message(self._guid_prefix, bytes(12), [data]),
                [proxy.metatraffic for proxy in self._proxies.values()],
            )
            self._socket.close()


def _matched_reader(
    send: SendSubmessages,
    prefix: bytes,
    reader_id: bytes,
    writer_id: bytes,
    deliver: Callable[[Data], None],
) -> StatefulReader:
    """Return a reader that is matched with a remote writer.

    Cyclone DDS sends a HEARTBEAT by itself, and takes the request for one as malformed.
    """
    reader = StatefulReader(send, reader_id, writer_id, deliver)
    if prefix.startswith(FAST_DDS):
        reader.request_heartbeat()
    return reader


def _on_message(subscription: Subscription, prefix: bytes, sample: Data) -> None:
    if sample.payload and not is_disposed(sample):
        subscription.receive(sample.payload, prefix + PARTICIPANT)


def _own_address(domain: int) -> str:
    """Return this machine's address on the network that multicast goes to."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((MULTICAST_GROUP, multicast_port(domain)))  # sends nothing
        except OSError:
            return "127.0.0.1"
        return str(probe.getsockname()[0])
