"""A gateway to ROS 2 over Zenoh: the hub is the router of programs with RMW_IMPLEMENTATION=rmw_zenoh_cpp."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import zenoh
from pydantic import Field

from devices.ros.gateway import Gateway
from devices.ros.params import GatewayParams
from devices.ros.transport import Transport
from devices.ros.zenoh.layout import graph_key
from schemas.errors import DeviceError

__all__ = ["ZenohGateway", "ZenohParams"]


class ZenohParams(GatewayParams):
    """Part of the dVRK on show, and the domain."""

    domain: int = Field(
        default=0,
        ge=0,
        le=232,
        description="ROS_DOMAIN_ID of the programs; 232 is the largest that ROS 2 allows",
    )


class ZenohGateway(Gateway):
    """The kind `ros2-zenoh`; a `hub.transport.router_client.RouterClient`."""

    kind = "ros2-zenoh"
    params_model = ZenohParams
    demands_secret = False

    def __init__(self, name: str, params: ZenohParams) -> None:
        super().__init__(name, params)
        self._domain = params.domain
        self._connect: Callable[[], zenoh.Session] | None = None

    @property
    def foreign_keys(self) -> tuple[str, ...]:
        """Keys of the domain's topics and services, of caches of their last messages, and of the graph."""
        return f"{self._domain}/**", f"{self._domain}/**/@adv/**", graph_key(self._domain)

    def learn_hub(self, connect: Callable[[], zenoh.Session]) -> None:
        """Receive the opener of Zenoh sessions with the hub."""
        self._connect = connect

    def connect(self, directory: Path) -> Transport:  # noqa: ARG002
        """Join the graph of the domain.

        Raises ConnectError if the hub cannot be reached, DeviceError if the device has no hub.
        """
        if self._connect is None:
            raise DeviceError(
                f"'{self.name}' needs the router of a hub, and was opened without one: run it in a session"
            )
        from devices.ros.zenoh.transport import ZenohTransport  # needs the extra

        return ZenohTransport(self._connect, self._domain)
