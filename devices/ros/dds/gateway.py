"""A gateway to ROS 2 over DDS: a node among others for programs with rmw_fastrtps or rmw_cyclonedds."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from devices.ros.gateway import Gateway
from devices.ros.params import GatewayParams
from devices.ros.transport import Transport
from schemas.errors import DeviceError, MissingExtraError

__all__ = ["DdsGateway", "DdsParams"]


class DdsParams(GatewayParams):
    """Part of the dVRK on show, and the domain."""

    domain: int = Field(
        default=0,
        ge=0,
        le=232,
        description="ROS_DOMAIN_ID of the programs; 232 is the largest that ROS 2 allows",
    )
    discovery: Literal["localhost", "subnet"] = Field(
        default="localhost",
        description=(
            "as ROS_AUTOMATIC_DISCOVERY_RANGE: programs on this machine, or on its network as well, where"
            " every program may then read and command, as DDS here checks no certificate"
        ),
    )
    peers: tuple[Annotated[str, Field(pattern=r"^[A-Za-z0-9_.:-]+$")], ...] = Field(
        default=(),
        description=(
            "as ROS_STATIC_PEERS: other machines to look for programs on; that opens the gateway to the"
            " network as `subnet` does"
        ),
    )


class DdsGateway(Gateway):
    """The kind `ros2-dds`."""

    kind = "ros2-dds"
    params_model = DdsParams

    def __init__(self, name: str, params: DdsParams) -> None:
        super().__init__(name, params)
        self._where = params

    def connect(self, directory: Path) -> Transport:  # noqa: ARG002
        """Join the domain.

        Raises MissingExtraError without Cyclone DDS, DeviceError if the domain cannot be joined.
        """
        try:
            from devices.ros.dds.domain import configuration, domain
            from devices.ros.dds.services import ServiceParticipant
            from devices.ros.dds.transport import DdsTransport
        except ModuleNotFoundError as error:
            raise MissingExtraError(f"device '{self.name}'", "ros2-dds", "cyclonedds") from error
        where = self._where
        # resolved here, because Cyclone DDS ends the process for a name that it cannot resolve
        peers = [_resolve_address(peer) for peer in where.peers]
        joined = domain(where.domain, configuration(where.discovery, peers))
        hosts = ["127.0.0.1", *peers] if where.discovery == "localhost" else peers
        services = ServiceParticipant(where.domain, multicast=where.discovery == "subnet", hosts=hosts)
        return DdsTransport(joined, where.domain, services)


def _resolve_address(peer: str) -> str:
    """Return the address of another machine. Raises DeviceError if the name cannot be resolved."""
    try:
        return socket.gethostbyname(peer)
    except (OSError, UnicodeError) as error:
        raise DeviceError(
            f"the peer '{peer}' is not known to this machine ({error}); expected a name that it knows, or an"
            " address (IPv4)"
        ) from error
