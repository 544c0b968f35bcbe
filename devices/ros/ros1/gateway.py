"""A gateway to ROS 1: a node in pure Python at the master of the console; the hub's machine needs no ROS."""

from __future__ import annotations

import os
import socket
from ipaddress import IPv4Address
from pathlib import Path
from typing import Annotated
from urllib.parse import urlsplit

from pydantic import Field, field_validator

from devices.ros.gateway import Gateway
from devices.ros.params import GatewayParams
from devices.ros.transport import Transport
from schemas.errors import DeviceError

__all__ = ["Ros1Gateway", "Ros1Params"]

_MASTER = "http://127.0.0.1:11311"
"""Where roscore listens by default."""


class Ros1Params(GatewayParams):
    """Part of the dVRK on show, and the ROS master."""

    master: Annotated[str, Field(pattern=r"^http://[^/:\s]+:\d+/?$")] | None = Field(
        default=None,
        description=(
            f"address of the ROS master; by default ROS_MASTER_URI of the gateway's environment, or {_MASTER}"
        ),
    )
    ip: IPv4Address | None = Field(
        default=None,
        description=(
            "address of this machine at which programs reach the gateway, which listens there only; by"
            " default that from which the master is reached: 127.0.0.1 for one on this machine. ROS 1"
            " identifies no program: each that reaches another address than 127.0.0.1 may command the arms"
        ),
    )

    @field_validator("ip")
    @classmethod
    def _check_reachable(cls, ip: IPv4Address | None) -> IPv4Address | None:
        if ip is not None and ip.is_unspecified:
            raise ValueError(
                f"{ip} is no address that a program could connect to; expected the address of this machine in"
                " one of its networks"
            )
        return ip


class Ros1Gateway(Gateway):
    """The kind `ros1`."""

    kind = "ros1"
    params_model = Ros1Params

    def __init__(self, name: str, params: Ros1Params) -> None:
        super().__init__(name, params)
        self._master, self._ip = params.master, params.ip

    def connect(self, directory: Path) -> Transport:  # noqa: ARG002
        """Start the node; the master may start later.

        Raises DeviceError if there is no route to the master, or if `ip` is not this machine.
        """
        from devices.ros.ros1.transport import Ros1Transport  # parses all definitions of Noetic

        master = self._master or os.environ.get("ROS_MASTER_URI") or _MASTER
        host = _address_towards(master) if self._ip is None else str(self._ip)
        try:
            return Ros1Transport(master, f"/trocar_{self.name}", host)
        except OSError as error:
            raise DeviceError(
                f"'{self.name}' cannot listen at {host} ({error}); `ip` must be an address of this machine"
            ) from error


def _address_towards(master: str) -> str:
    """Return the address of this machine on the route to a master.

    Raises DeviceError if there is no route.
    """
    try:
        address = urlsplit(master)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.connect((address.hostname, address.port))  # sends nothing
            return str(sock.getsockname()[0])
    except (OSError, ValueError, TypeError) as error:
        raise DeviceError(
            f"there is no route to the ROS master at '{master}' ({error}); expected http://HOST:PORT, with a"
            " host that this machine can resolve"
        ) from error
