"""Where on the network a gateway looks for ROS programs on DDS."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal
from weakref import WeakValueDictionary
from xml.sax.saxutils import quoteattr

from cyclonedds.core import DDSException
from cyclonedds.domain import Domain

from schemas.errors import DeviceError

__all__ = ["Discovery", "configuration", "domain"]

Discovery = Literal["localhost", "subnet"]

_MOST_PROGRAMS = 32
"""Participants on one machine that are looked for where there is no multicast, as in rmw_fastrtps and rmw_cyclonedds."""

_NEVER_WAIT = "<WhcHigh>1GB</WhcHigh><WhcHighInit>1GB</WhcHighInit><WhcAdaptive>false</WhcAdaptive>"
"""Cyclone DDS makes a writer wait for slow readers by how many bytes they owe it; ours keep only the last messages, which is limit enough."""


class _Settled(Domain):
    """A domain that remembers how it was made."""

    def __init__(self, number: int, settings: str) -> None:
        super().__init__(number, settings)
        self.settings = settings


_domains: WeakValueDictionary[int, _Settled] = WeakValueDictionary()
"""Cyclone DDS has one of a number in a process; it goes with the last gateway that holds it."""


def domain(number: int, settings: str) -> Domain:
    """Return the domain of this process with this number. Raises DeviceError if there is one with other settings, or none can be made."""
    found = _domains.get(number)
    if found is not None and found.settings != settings:
        raise DeviceError(f"two gateways of one process in domain {number} have to say the same of `discovery` and `peers`; give one a `host` of its own")
    if found is None:
        try:
            found = _domains[number] = _Settled(number, settings)
        except DDSException as error:
            raise DeviceError(f"DDS cannot take part in domain {number}: {error.msg}") from error
    return found


def configuration(discovery: Discovery, peers: Sequence[str]) -> str:
    """Return the settings (XML, of Eclipse Cyclone DDS's docs/manual/config) for what ROS_AUTOMATIC_DISCOVERY_RANGE and ROS_STATIC_PEERS say to ROS programs.

    Nothing leaves the loopback interface unless `discovery` or `peers` ask for it.
    """
    loopback = discovery == "localhost" and not peers
    interfaces = '<Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces><FragmentSize>64000B</FragmentSize>' if loopback else ""
    sizes = "<MaxMessageSize>65000B</MaxMessageSize>" if loopback else ""
    multicast = f"<AllowMulticast>{'true' if discovery == 'subnet' else 'false'}</AllowMulticast>"
    sought = [*(["localhost"] if discovery == "localhost" else []), *peers]
    found = f"<Peers>{''.join(f'<Peer address={quoteattr(peer)}/>' for peer in sought)}</Peers>" if sought else ""
    index = f"<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>{_MOST_PROGRAMS}</MaxAutoParticipantIndex>"
    return (
        f"<CycloneDDS><Domain><General>{interfaces}{multicast}{sizes}</General><Discovery>{index}{found}</Discovery>"
        f"<Internal><Watermarks>{_NEVER_WAIT}</Watermarks></Internal></Domain></CycloneDDS>"
    )
