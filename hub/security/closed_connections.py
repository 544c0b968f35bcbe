"""The remote addresses of closed TCP connections, as reported by Linux.

See sock_diag(7) and linux/inet_diag.h.
"""

from __future__ import annotations

import errno
import socket
import struct
from collections.abc import Collection, Iterator
from ipaddress import ip_address

__all__ = ["closed_connections"]

_SOCK_DIAG = 4
_TCP_DESTROY = 1 << 0
"""The group SKNLGRP_INET_TCP_DESTROY, as a bit of the address."""

_FAMILY, _PORTS, _SOURCE_BYTES, _TARGET_BYTES = 16, struct.Struct(">HH"), 24, 40
"""Offsets behind the header of 16 bytes.

struct inet_diag_msg begins with the family, sockid with both ports and both addresses.
"""


def closed_connections(ports: Collection[int], look_s: float) -> Iterator[str | None]:
    """Yield the remote address and port of each closed connection to `ports` of this machine.

    Yields None after `look_s` seconds without a closed connection. Raises OSError on systems without such
    reports: not Linux, or without the module inet_diag.
    """
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, _SOCK_DIAG) as reports:
        reports.bind((0, _TCP_DESTROY))
        reports.settimeout(look_s)
        while True:
            try:
                message = reports.recv(4096)
            except TimeoutError:
                yield None
                continue
            except OSError as error:
                if error.errno == errno.ENOBUFS:  # more reports than fit into the buffer of the socket
                    continue
                raise
            port, other_port = _PORTS.unpack_from(message, _SOURCE_BYTES - _PORTS.size)
            if port in ports and other_port:  # the listening socket itself has no remote port
                length = 4 if message[_FAMILY] == socket.AF_INET else 16
                yield f"{_as_text(message[_TARGET_BYTES : _TARGET_BYTES + length])}:{other_port}"


def _as_text(address: bytes) -> str:
    ip = ip_address(address)
    if ip.version == 4:
        return str(ip)
    return f"[{ip}]" if ip.ipv4_mapped is None else str(ip.ipv4_mapped)
