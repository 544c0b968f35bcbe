"""Services and subscriptions over DDS: an RTPS participant of our own, with readers and writers.

Programs with rmw_fastrtps tell requests apart by inline QoS, and Cyclone DDS gives no access to inline QoS;
so services need a participant of their own, with the servers as only visible part. The participant answers
programs with rmw_cyclonedds, too: of two servers a program would use the first discovered. Subscriptions are
here because a reader of Cyclone DDS loses messages sent before Cyclone DDS has matched reader and writer, and
a program publishes as soon as its own side is matched (docs/decisions/0030).
"""

from __future__ import annotations

import logging
import os
import struct
import threading
from collections import deque
from collections.abc import Callable, Sequence
from time import monotonic

from devices.ros.dds.endpoints import ReceiveSample, Service, Subscription
from devices.ros.dds.matching import Matching
from devices.ros.dds.participant_proxy import ParticipantProxy
from devices.ros.dds.responses import CYCLONE_DDS, FAST_DDS
from devices.ros.dds.rtps import Data, Message, encode_data, encode_message, parse_message
from devices.ros.dds.rtps_discovery import (
    LEASE_S,
    READER_NO_KEY,
    SPDP_READER,
    SPDP_WRITER,
    WRITER_NO_KEY,
    announced_participant,
    is_disposed,
    participant_data,
    participant_disposal,
)
from devices.ros.dds.rtps_socket import RtpsSocket
from devices.ros.transport import ServiceHandler
from schemas.errors import MessageError

__all__ = ["ServiceParticipant"]

log = logging.getLogger(__name__)

_NO_VENDOR = b"\x00\x00"
"""The first two bytes of our GUID prefix."""
_ANNOUNCE_S, _FORGET_S = 1.0, 3600.0
"""Period of our announcements, and time until a silent participant is forgotten, s: a participant stopped for
longer than its lease, as in a debugger, goes on with the known sequence numbers.
"""
_INTRODUCE_AGAIN_S = (0.005, 0.02)
"""Delays after the first answer to a program, s: Fast DDS announces a program before it receives anything."""
_MOST_PARTICIPANTS = 512
"""Most participants of a domain: memory is limited, whatever is sent on the domain."""


class ServiceParticipant:
    """The services and subscriptions of a domain, with a socket and a thread of their own."""

    def __init__(self, domain: int, *, multicast: bool, hosts: Sequence[str]) -> None:
        """Start discovery of a domain.

        Args:
            domain: number of the domain.
            multicast: whether to announce ourselves to the network.
            hosts: addresses of machines for announcements. With 127.0.0.1 alone, without multicast, the
                socket receives from this machine only.
        """
        self._gateway = self._gateway_announcement = b""
        self._domain = domain
        self.joined: Callable[[], None] = lambda: None
        """Called, in the thread of this participant, by every program that joins the domain."""
        self._introductions: deque[tuple[float, bytes]] = deque()
        """Times at which new programs, by GUID prefix, are told again of us."""
        self._guid_prefix = _NO_VENDOR + os.urandom(10)
        self._socket = RtpsSocket(domain, multicast=multicast, hosts=hosts)
        self._matching = Matching(self._guid_prefix, self._socket.send)
        self._changing = threading.Lock()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="DDS services", daemon=True)
        self._thread.start()

    def ignore(self, guid: bytes) -> None:
        """Ignore the participant with this GUID: the same gateway's on Cyclone DDS, without clients.

        Its announcement is passed on to new programs.
        """
        with self._changing:
            self._gateway = guid[:12]
            self._matching.proxies.pop(self._gateway, None)  # it may be discovered already

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
        with self._changing:
            key = self._matching.next_key()
            service = Service(
                f"rq{topic}Request",
                f"rr{topic}Reply",
                f"{package}::{group}::dds_::{name}_",
                key + READER_NO_KEY,
                key + WRITER_NO_KEY,
                handle,
            )
            self._matching.add_service(service)
        return self._guid_prefix + service.reader_id, self._guid_prefix + service.writer_id

    def subscribe(self, topic: str, ros_type: str, user_data: str, receive: ReceiveSample) -> bytes:
        """Subscribe to a topic, reliable and volatile.

        Every message of a writer is received once and in order from the match on the writer's side on, within
        the writer's history; a message in fragments up to `fragments.MOST_BYTES`.

        Args:
            topic: name of the ROS topic: `/PSM1/state_command`.
            ros_type: `crtk_msgs/msg/StringStamped`.
            user_data: user data announced with the reader.
            receive: called with every message, in the thread of this participant.

        Returns:
            GUID (16 bytes) of the reader.
        """
        package, group, name = ros_type.split("/")
        with self._changing:
            subscription = Subscription(
                f"rt{topic}",
                f"{package}::{group}::dds_::{name}_",
                self._matching.next_key() + READER_NO_KEY,
                user_data,
                receive,
            )
            self._matching.add_subscription(subscription)
        return self._guid_prefix + subscription.reader_id

    def matched_topics(self) -> set[str]:
        """Return the DDS topics with a writer matched with a reader of ours."""
        with self._changing:
            return self._matching.matched_topics()

    def _run(self) -> None:
        due = monotonic()
        while not self._ended.is_set():
            now = monotonic()
            if now >= due:
                due = now + _ANNOUNCE_S
                self._announce_participant(self._socket.targets)
                self._maintain(now)
            self._introduce_again(now)
            waking = min(due, self._introductions[0][0]) if self._introductions else due
            try:
                datagram, host = self._socket.receive(max(waking - monotonic(), 0.001))
            except OSError:  # nothing has arrived, or an earlier datagram did not reach its target
                continue
            try:
                message = parse_message(datagram, self._guid_prefix)
                if message.guid_prefix == self._gateway:
                    self._note_gateway(message, datagram)
                else:
                    self._receive(message, host)
            except (MessageError, struct.error) as error:
                log.debug("a datagram from %s is dropped: %s", host, error)
            # an unforeseen error must not end the service for other programs
            except Exception:
                log.exception("a datagram from %s makes services fail", host)

    def _maintain(self, now: float) -> None:
        """Forget silent participants, and send due HEARTBEATs to the others."""
        with self._changing:
            proxies = self._matching.proxies
            for prefix in [it for it, proxy in proxies.items() if now - proxy.announced_s >= _FORGET_S]:
                del proxies[prefix]
            for proxy in proxies.values():
                if now - proxy.announced_s < LEASE_S:
                    for writer in proxy.writers.values():
                        writer.send_heartbeat()

    def _receive(self, message: Message, host: str) -> None:
        prefix = message.guid_prefix
        if prefix[:2] not in (FAST_DDS, CYCLONE_DDS):
            return
        with self._changing:
            for part in message.submessages:
                proxy = self._matching.proxies.get(prefix)
                if isinstance(part, Data) and part.writer_id == SPDP_WRITER:
                    self._on_participant(prefix, part, host)
                elif proxy is not None:
                    self._matching.receive(prefix, proxy, part)

    def _on_participant(self, prefix: bytes, announcement: Data, host: str) -> None:
        """SPDP: the announcement of a participant, or of a participant's end."""
        proxies = self._matching.proxies
        if is_disposed(announcement):
            proxies.pop(prefix, None)
            return
        known = proxies.get(prefix)
        if known is not None:
            known.announced_s = monotonic()
            return
        if len(proxies) >= _MOST_PARTICIPANTS:
            raise MessageError(f"a participant of RTPS beside {_MOST_PARTICIPANTS} others is not answered")
        metatraffic, default = ((host, port) for port in announced_participant(announcement))
        proxy = ParticipantProxy(metatraffic, default, monotonic())
        self._matching.add_program(prefix, proxy)
        self.joined()
        self._introduce(proxy)
        self._matching.announce_all(proxy)
        self._introductions.extend((proxy.announced_s + delay, prefix) for delay in _INTRODUCE_AGAIN_S)

    def _introduce(self, proxy: ParticipantProxy) -> None:
        """Announce both participants of the gateway to a program."""
        self._announce_participant([proxy.metatraffic])
        if self._gateway_announcement:
            self._socket.send(self._gateway_announcement, [proxy.metatraffic])

    def _introduce_again(self, now: float) -> None:
        with self._changing:
            while self._introductions and self._introductions[0][0] <= now:
                proxy = self._matching.proxies.get(self._introductions.popleft()[1])
                if proxy is not None:
                    self._introduce(proxy)
                    for writer in proxy.writers.values():
                        writer.send_heartbeat()

    def _note_gateway(self, message: Message, datagram: bytes) -> None:
        """Keep the announcement of the same gateway's participant on Cyclone DDS, if it is for everybody."""
        if self._guid_prefix in datagram:
            return
        for part in message.submessages:
            if isinstance(part, Data) and part.writer_id == SPDP_WRITER:
                self._gateway_announcement = b"" if is_disposed(part) else datagram

    def _announce_participant(self, targets: Sequence[tuple[str, int]]) -> None:
        """SPDP: announce ourselves."""
        payload = participant_data(self._guid_prefix, self._domain, self._socket.host, self._socket.port)
        data = encode_data(SPDP_WRITER, SPDP_READER, 1, payload)
        self._socket.send(encode_message(self._guid_prefix, bytes(12), [data]), targets)

    def close(self) -> None:
        """Leave the domain. May be called twice."""
        if not self._ended.is_set():
            self._ended.set()
            self._thread.join(timeout=2.0)
            data = encode_data(SPDP_WRITER, SPDP_READER, 2, b"", participant_disposal(self._guid_prefix))
            self._socket.send(
                encode_message(self._guid_prefix, bytes(12), [data]),
                [proxy.metatraffic for proxy in self._matching.proxies.values()],
            )
            self._socket.close()
