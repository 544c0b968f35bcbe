"""Matching of programs' endpoints with our services and subscriptions, by SEDP.

Nothing here locks: the participant makes all calls, one after the other.
"""

from __future__ import annotations

import logging
import struct
from collections.abc import Callable, Sequence
from functools import partial

from devices.ros.dds.endpoints import Service, Subscription
from devices.ros.dds.participant_proxy import ParticipantProxy, require_room
from devices.ros.dds.responses import FAST_DDS, ResponseTo
from devices.ros.dds.rtps import AckNack, Data, FromWriter, encode_message, encode_string
from devices.ros.dds.rtps_discovery import (
    PARTICIPANT,
    PUBLICATIONS_READER,
    PUBLICATIONS_WRITER,
    SUBSCRIPTIONS_READER,
    SUBSCRIPTIONS_WRITER,
    announced_endpoint,
    disposed_endpoint_id,
    endpoint_data,
    is_disposed,
)
from devices.ros.dds.stateful import SendSubmessages, StatefulReader, StatefulWriter
from schemas.errors import MessageError

__all__ = ["Matching"]

log = logging.getLogger(__name__)

Send = Callable[[bytes, Sequence[tuple[str, int]]], None]
"""Sends a datagram to addresses."""


class Matching:
    """Our services and subscriptions, and the matched programs.

    Args:
        guid_prefix: GUID prefix of our participant, 12 bytes.
        send: Sends a datagram.
    """

    def __init__(self, guid_prefix: bytes, send: Send) -> None:
        self._guid_prefix, self._send = guid_prefix, send
        self._services: list[Service] = []
        self._subscriptions: list[Subscription] = []
        self.proxies: dict[bytes, ParticipantProxy] = {}
        """The programs, by GUID prefix."""

    def next_key(self) -> bytes:
        """Return the key of the next endpoint: the first three bytes of EntityIds."""
        return struct.pack(">I", len(self._services) + len(self._subscriptions) + 1)[1:]

    def add_service(self, service: Service) -> None:
        """Announce a service, and match existing clients."""
        self._services.append(service)
        for proxy in self.proxies.values():
            self._announce_endpoints(proxy, service)
        self._match_publications()

    def add_subscription(self, subscription: Subscription) -> None:
        """Announce a subscription, and match existing writers."""
        self._subscriptions.append(subscription)
        for proxy in self.proxies.values():
            self._announce_subscription(proxy, subscription)
        self._match_publications()

    def add_program(self, prefix: bytes, proxy: ParticipantProxy) -> None:
        """Exchange endpoints with a new program."""
        self.proxies[prefix] = proxy
        send = self._sender(prefix, proxy.metatraffic)
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
            proxy.writers[writer_id, reader_id] = StatefulWriter(send, writer_id, reader_id, keeps_all=True)

    def announce_all(self, proxy: ParticipantProxy) -> None:
        """Announce all endpoints to a program."""
        for service in self._services:
            self._announce_endpoints(proxy, service)
        for subscription in self._subscriptions:
            self._announce_subscription(proxy, subscription)

    def receive(self, prefix: bytes, proxy: ParticipantProxy, part: AckNack | FromWriter) -> None:
        """Receive a submessage of a program; raises MessageError for an invalid submessage."""
        if isinstance(part, AckNack):
            if (writer := proxy.writers.get((part.writer_id, part.reader_id))) is not None:
                writer.on_acknack(part)
        elif (reader := proxy.readers.get(part.writer_id)) is not None:
            reader.receive(part)
        else:
            self._on_unmatched(prefix, proxy, part)

    def matched_topics(self) -> set[str]:
        """Return the DDS topics with a writer matched with a reader of ours."""
        ids = {reader.reader_id for proxy in self.proxies.values() for reader in proxy.readers.values()}
        return {subscription.topic for subscription in self._subscriptions if subscription.reader_id in ids}

    def _match_publications(self) -> None:
        for prefix, proxy in self.proxies.items():
            for writer_id in proxy.publications:
                self._match_publication(prefix, writer_id)

    def _on_publication(self, prefix: bytes, announcement: Data) -> None:
        """SEDP: match a client's writer with a reader, or remove the match."""
        proxy = self.proxies[prefix]
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
        """Match a writer with our reader of the same topic, if any.

        A repeated announcement keeps the reader, with the record of received samples.
        """
        proxy = self.proxies[prefix]
        found = self._reader_of(proxy.publications[writer_id], prefix)
        if found is not None and writer_id not in proxy.readers:
            self._match_endpoint(prefix, proxy, writer_id, *found)

    def _on_unmatched(self, prefix: bytes, proxy: ParticipantProxy, part: FromWriter) -> None:
        """Match an undiscovered writer with the addressed reader, or discover the writer now."""
        if part.writer_id in proxy.gone:
            return
        proxy.unmatched.append(part)
        for subscription in self._subscriptions:
            if subscription.reader_id == part.reader_id:
                deliver = partial(_on_message, subscription, prefix)
                self._match_endpoint(prefix, proxy, part.writer_id, part.reader_id, deliver)
                return
        if prefix.startswith(FAST_DDS):
            proxy.readers[PUBLICATIONS_WRITER].request_heartbeat()

    def _match_endpoint(
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
        """Return EntityId and handler of our reader of a topic (in the form of a parameter)."""
        for service in self._services:
            if topic.startswith(encode_string(service.request_topic)):
                return service.reader_id, partial(self._on_request, service, prefix)
        for subscription in self._subscriptions:
            if topic.startswith(encode_string(subscription.topic)):
                return subscription.reader_id, partial(_on_message, subscription, prefix)
        return None

    def _on_subscription(self, prefix: bytes, announcement: Data) -> None:
        """SEDP: match a client's reader of responses with a writer, or remove the match."""
        proxy = self.proxies[prefix]
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
        proxy, response = self.proxies[prefix], ResponseTo(request, prefix)
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


def _matched_reader(
    send: SendSubmessages,
    prefix: bytes,
    reader_id: bytes,
    writer_id: bytes,
    deliver: Callable[[Data], None],
) -> StatefulReader:
    """Return a reader matched with a remote writer.

    Cyclone DDS sends HEARTBEATs unasked, and considers a request for a HEARTBEAT malformed.
    """
    reader = StatefulReader(send, reader_id, writer_id, deliver)
    if prefix.startswith(FAST_DDS):
        reader.request_heartbeat()
    return reader


def _on_message(subscription: Subscription, prefix: bytes, sample: Data) -> None:
    if sample.payload and not is_disposed(sample):
        subscription.receive(sample.payload, prefix + PARTICIPANT)
