"""The socket of an RTPS participant: receiving address, and targets of announcements."""

from __future__ import annotations

import logging
import select
import socket
from collections.abc import Sequence

from devices.ros.dds.rtps_discovery import MULTICAST_GROUP, multicast_port, unicast_ports

__all__ = ["RtpsSocket"]

log = logging.getLogger(__name__)

_LARGEST = 65536
"""Bytes of a datagram, UDP's most."""


class RtpsSocket:
    """Sends and receives the datagrams of a participant in `domain`.

    A program announces itself to the first ports of a machine, or by multicast, and both arrive here.

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
        self._socket = _bound("127.0.0.1" if is_local else "", domain)
        self._announcements = _multicast_socket(domain, is_local=is_local)
        self._sockets = [it for it in (self._socket, self._announcements) if it is not None]
        self.host = "127.0.0.1" if is_local else _own_address(domain)
        """Announced address of this machine."""
        self._is_local = is_local

    @property
    def port(self) -> int:
        """Receiving port."""
        return int(self._socket.getsockname()[1])

    def receive(self, seconds: float) -> tuple[bytes, str]:
        """Return the next datagram and the address at which its sender is answered.

        Raises OSError if no datagram comes within `seconds`, or an earlier datagram of ours did not arrive.
        """
        ready = select.select(self._sockets, (), (), seconds)[0]
        if not ready:
            raise TimeoutError
        datagram, address = ready[0].recvfrom(_LARGEST)
        return datagram, self.host if self._is_local else str(address[0])

    def send(self, datagram: bytes, targets: Sequence[tuple[str, int]]) -> None:
        """Send a datagram to each reachable target."""
        for target in targets:
            try:
                self._socket.sendto(datagram, target)
            except OSError as error:  # the other targets may be reachable
                log.debug("nothing can be sent to %s: %s", target, error)

    def close(self) -> None:
        """Receive no more."""
        for each in self._sockets:
            each.close()


def _bound(host: str, domain: int) -> socket.socket:
    """Return a socket at the first free port of the domain at which programs announce themselves."""
    bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    for port in (*unicast_ports(domain), 0):
        try:
            bound.bind((host, port))
        except OSError:  # of another participant
            continue
        break
    return bound


def _multicast_socket(domain: int, *, is_local: bool) -> socket.socket | None:
    """Return a socket with the announcements by multicast, of this machine alone if `is_local`."""
    joined = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    interface = "127.0.0.1" if is_local else "0.0.0.0"
    member = socket.inet_aton(MULTICAST_GROUP) + socket.inet_aton(interface)
    try:
        joined.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if is_local and hasattr(socket, "SO_BINDTODEVICE"):
            joined.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, b"lo\0")
        joined.bind((MULTICAST_GROUP, multicast_port(domain)))
        joined.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)
    except OSError as error:
        log.debug("announcements by multicast are not received: %s", error)
        joined.close()
        return None
    return joined


def _own_address(domain: int) -> str:
    """Return this machine's address on the network of multicast."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((MULTICAST_GROUP, multicast_port(domain)))  # sends nothing
        except OSError:
            return "127.0.0.1"
        return str(probe.getsockname()[0])
