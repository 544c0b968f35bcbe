"""The DDS domain of a gateway: network range of discovery and of access."""

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

from devices.ros.dds.rtps_discovery import multicast_port
from schemas.errors import DeviceError

__all__ = ["DiscoveryRange", "configuration", "domain"]

DiscoveryRange = Literal["localhost", "subnet"]

_OPEN_FILES = Path("/proc/self/fd")

_LOOPBACK_ONLY = (
    '<Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>'
    "<MaxMessageSize>65000B</MaxMessageSize><FragmentSize>64000B</FragmentSize>"
)
"""Packets as large as UDP allows, because the loopback interface splits none."""

_SPDP = (
    "<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
    "<SPDPInterval>1s</SPDPInterval><InitialLocatorPruneDelay>inf</InitialLocatorPruneDelay>"
)
"""Number of participants per machine announced to without multicast, as with rmw_fastrtps and rmw_cyclonedds,
and period of announcements, which Cyclone DDS otherwise ends after 30 s where no program has answered.
"""

_NEVER_WAIT = (
    "<Watermarks><WhcHigh>1GB</WhcHigh><WhcHighInit>1GB</WhcHighInit><WhcAdaptive>false</WhcAdaptive></Watermarks>"
    "<WriterLingerDuration>0s</WriterLingerDuration>"
)
"""Without waits: Cyclone DDS blocks a writer while slow readers leave too many bytes unacknowledged, but our
writers keep only the last messages, a sufficient limit. And a deleted writer waits for its readers, each
writer in turn.
"""


class _ConfiguredDomain(Domain):
    """A domain with its configuration."""

    def __init__(self, number: int, settings: str) -> None:
        super().__init__(number, settings)
        self.settings = settings


_domains: WeakValueDictionary[int, _ConfiguredDomain] = WeakValueDictionary()
"""Domains of this process by number: Cyclone DDS has a single domain per number, ended with the last gateway.
"""


def domain(number: int, settings: str) -> Domain:
    """Return the domain of this process with this number.

    Raises DeviceError if the domain exists with another configuration, or cannot be created.
    """
    found = _domains.get(number)
    if found is not None and found.settings != settings:
        raise DeviceError(
            f"two gateways of one process in domain {number} must have the same `discovery` and `peers`; give"
            " one a `host` of its own"
        )
    if found is None:
        try:
            found = _domains[number] = _ConfiguredDomain(number, settings)
            if _LOOPBACK_ONLY in settings:
                _confine(number)
        except DDSException as error:
            raise DeviceError(f"DDS cannot take part in domain {number}: {error.msg}") from error
        except PermissionError as error:  # before Linux 5.7 only root may
            why = f"this system does not allow its sockets to be bound to the loopback interface ({error})"
            raise DeviceError(
                f"DDS cannot take part in domain {number}: {why}; `discovery: subnet` opens it to the network"
            ) from error
    return found


def configuration(discovery: DiscoveryRange, peers: Sequence[str]) -> str:
    """Return the XML configuration of Cyclone DDS (Cyclone's docs/manual/config).

    Nothing leaves the loopback interface unless `discovery` or `peers` demand it.

    Args:
        discovery: ROS_AUTOMATIC_DISCOVERY_RANGE of ROS programs.
        peers: ROS_STATIC_PEERS of ROS programs.
    """
    general = f"<AllowMulticast>{'true' if discovery == 'subnet' else 'false'}</AllowMulticast>"
    if discovery == "localhost" and not peers:
        general += _LOOPBACK_ONLY
    targets = [*(["localhost"] if discovery == "localhost" else []), *peers]
    listed = "".join(f"<Peer address={quoteattr(peer)}/>" for peer in targets)
    spdp = _SPDP + (f"<Peers>{listed}</Peers>" if targets else "")
    return (
        f"<CycloneDDS><Domain><General>{general}</General><Discovery>{spdp}</Discovery>"
        f"<Internal>{_NEVER_WAIT}</Internal></Domain></CycloneDDS>"
    )


def _confine(number: int) -> None:
    """Bind the domain's sockets to the loopback interface: Cyclone DDS binds to all, however configured.

    Linux only (SO_BINDTODEVICE); elsewhere this is the task of a firewall.
    """
    ports = range(multicast_port(number), multicast_port(number + 1))
    for entry in _OPEN_FILES.iterdir() if _OPEN_FILES.is_dir() else ():
        try:
            if not stat.S_ISSOCK(entry.stat().st_mode):
                continue
            ours = socket.socket(fileno=os.dup(int(entry.name)))
        except OSError:  # closed in the meantime
            continue
        with ours:
            if (
                ours.family == socket.AF_INET
                and ours.type == socket.SOCK_DGRAM
                and ours.getsockname()[1] in ports
            ):
                ours.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, b"lo\0")
