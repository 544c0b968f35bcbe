"""The socket of an RTPS participant: receiving address, and targets of announcements."""

from __future__ import annotations

import logging
import socket
from collections.abc import Sequence

from devices.ros.dds.rtps_discovery import MULTICAST_GROUP, multicast_port, unicast_ports

__all__ = ["RtpsSocket"]

log = logging.getLogger(__name__)

_LARGEST = 65536
"""Bytes of a datagram, UDP's most."""


class RtpsSocket:
    """Sends and receives the datagrams of a participant in `domain`.

    Args:
        domain: Number of the domain.
        multicast: Whether to announce the participant to the network.
        hosts: Addresses of machines for announcements. With 127.0.0.1 alone, without multicast, the socket
            receives from this machine only.
    """

    def __init__(self, domain: int, *, multicast: bool, hosts: Sequence[str]) -> None:
        is_local = not multicast and all(host == "127.0.0.1" for host in hosts)
        self.targets = [(host, port) for host in hosts for port in unicast_ports(domain)] + (
            [(MULTICAST_GROUP, multicast_port(domain))] if multicast else []
        )
        """Target addresses of announcements."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1" if is_local else "", 0))
        self.host = "127.0.0.1" if is_local else _own_address(domain)
        """Announced address of this machine."""

    @property
    def port(self) -> int:
        """Receiving port."""
        return int(self._socket.getsockname()[1])

    def receive(self, seconds: float) -> tuple[bytes, str]:
        """Return the next datagram and the sender's address.

        Raises OSError if no datagram comes within `seconds`, or an earlier datagram of ours did not arrive.
        """
        self._socket.settimeout(seconds)
        datagram, address = self._socket.recvfrom(_LARGEST)
        return datagram, str(address[0])

    def send(self, datagram: bytes, targets: Sequence[tuple[str, int]]) -> None:
        """Send a datagram to each reachable target."""
        for target in targets:
            try:
                self._socket.sendto(datagram, target)
            except OSError as error:  # the other targets may be reachable
                log.debug("nothing can be sent to %s: %s", target, error)

    def close(self) -> None:
        """Receive no more."""
        self._socket.close()


def _own_address(domain: int) -> str:
    """Return this machine's address on the network of multicast."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((MULTICAST_GROUP, multicast_port(domain)))  # sends nothing
        except OSError:
            return "127.0.0.1"
        return str(probe.getsockname()[0])
