"""Where on the network a gateway looks for ROS programs on DDS."""

from __future__ import annotations

import os
import socket
import stat
from collections.abc import Sequence
from pathlib import Path
from typing import Literal
from weakref import WeakValueDictionary
from xml.sax.saxutils import quoteattr

from cyclonedds.core import DDSException
from cyclonedds.domain import Domain

from schemas.errors import DeviceError

__all__ = ["Discovery", "configuration", "domain"]

Discovery = Literal["localhost", "subnet"]

_LOOPBACK_ONLY = (
    "<Interfaces><NetworkInterface"
    ' address="127.0.0.1"/></Interfaces><MaxMessageSize>65000B</MaxMessageSize><FragmentSize>64000B</FragmentSize>'
)
"""Packets as large as UDP takes, as nothing on the way is smaller."""

_ANNOUNCED = "<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><SPDPInterval>1s</SPDPInterval>"
"""Participants on one machine that are looked for where there is no multicast, as many as rmw_fastrtps and
rmw_cyclonedds look for, and how often: a program with the default range does not look for others in this way,
and waits for that.
"""

_NEVER_WAIT = (
    "<Watermarks><WhcHigh>1GB</WhcHigh><WhcHighInit>1GB</WhcHighInit><WhcAdaptive>false</WhcAdaptive></Watermarks>"
    "<WriterLingerDuration>0s</WriterLingerDuration>"
)
"""Cyclone DDS makes a writer wait for slow readers by how many bytes they have not acknowledged; ours keep
only the last messages, which is limit enough. And a writer that is deleted waits for them, one after the
other.
"""


class _Settled(Domain):
    """A domain that remembers how it was made."""

    def __init__(self, number: int, settings: str) -> None:
        super().__init__(number, settings)
        self.settings = settings


_domains: WeakValueDictionary[int, _Settled] = WeakValueDictionary()
"""Cyclone DDS has one of a number in a process; it goes with the last gateway that holds it."""


def domain(number: int, settings: str) -> Domain:
    """Return the domain of this process with this number.

    Raises DeviceError if there is one with other settings, or none can be made.
    """
    found = _domains.get(number)
    if found is not None and found.settings != settings:
        raise DeviceError(
            f"two gateways of one process in domain {number} have to say the same of `discovery` and `peers`;"
            " give one a `host` of its own"
        )
    if found is None:
        try:
            found = _domains[number] = _Settled(number, settings)
            if _LOOPBACK_ONLY in settings:
                _confine(number)
        except DDSException as error:
            raise DeviceError(f"DDS cannot take part in domain {number}: {error.msg}") from error
        except PermissionError as error:  # before Linux 5.7 that is root's
            why = f"this system does not let its sockets be bound to the loopback interface ({error})"
            raise DeviceError(
                f"DDS cannot take part in domain {number}: {why}; `discovery: subnet` opens it to the network"
            ) from error
    return found


def configuration(discovery: Discovery, peers: Sequence[str]) -> str:
    """Return the settings (XML, of Eclipse Cyclone DDS's docs/manual/config) for what
    ROS_AUTOMATIC_DISCOVERY_RANGE and ROS_STATIC_PEERS say to ROS programs.

    Nothing leaves the loopback interface unless `discovery` or `peers` ask for it.
    """
    general = f"<AllowMulticast>{'true' if discovery == 'subnet' else 'false'}</AllowMulticast>"
    if discovery == "localhost" and not peers:
        general += _LOOPBACK_ONLY
    sought = [*(["localhost"] if discovery == "localhost" else []), *peers]
    found = (
        f"<Peers>{''.join(f'<Peer address={quoteattr(peer)}/>' for peer in sought)}</Peers>" if sought else ""
    )
    return f"<CycloneDDS><Domain><General>{general}</General><Discovery>{_ANNOUNCED}{found}</Discovery><Internal>{_NEVER_WAIT}</Internal></Domain></CycloneDDS>"


def _confine(number: int) -> None:
    """Let nothing reach the domain's sockets but what comes over the loopback interface: Cyclone DDS binds
    them to all, whatever it is told to use.

    Linux only (SO_BINDTODEVICE); elsewhere a firewall has to do it.
    """
    ports = range(_FIRST_PORT + number * _PORTS, _FIRST_PORT + (number + 1) * _PORTS)
    for entry in _OPEN_FILES.iterdir() if _OPEN_FILES.is_dir() else ():
        try:
            if not stat.S_ISSOCK(entry.stat().st_mode):
                continue
            ours = socket.socket(fileno=os.dup(int(entry.name)))
        except OSError:  # closed meanwhile
            continue
        with ours:
            if (
                ours.family == socket.AF_INET
                and ours.type == socket.SOCK_DGRAM
                and ours.getsockname()[1] in ports
            ):
                ours.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, b"lo\0")


_OPEN_FILES = Path("/proc/self/fd")
_FIRST_PORT, _PORTS = 7400, 250
"""UDP ports of a domain: OMG DDSI-RTPS 2.5, 9.6.2.3."""
