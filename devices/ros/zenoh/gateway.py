"""A gateway to ROS 2 over Zenoh: programs with RMW_IMPLEMENTATION=rmw_zenoh_cpp connect to the hub, which is
the router that they look for.
"""

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
    """Which part of the dVRK is shown, and to whom."""

    domain: int = Field(
        default=0,
        ge=0,
        le=232,
        description="ROS_DOMAIN_ID of the programs; 232 is the largest that ROS 2 allows",
    )


class ZenohGateway(Gateway):
    """The kind `ros2-zenoh`."""

    kind = "ros2-zenoh"
    params_model = ZenohParams

    def __init__(self, name: str, params: ZenohParams) -> None:
        """Take the participant's name and its parameters."""
        super().__init__(name, params)
        self._domain = params.domain
        self._connect: Callable[[], zenoh.Session] | None = None

    @property
    def foreign_keys(self) -> tuple[str, ...]:
        """Topics and services of the domain, what keeps their last messages, and the graph."""
        return f"{self._domain}/**", f"{self._domain}/**/@adv/**", graph_key(self._domain)

    def learn_hub(self, connect: Callable[[], zenoh.Session]) -> None:
        """Take what opens a Zenoh session with the hub."""
        self._connect = connect

    def connect(self, directory: Path) -> Transport:  # noqa: ARG002
        """Join the graph of the domain.

        Raises ConnectError if the hub cannot be reached, DeviceError if there is none.
        """
        if self._connect is None:
            raise DeviceError(
                f"'{self.name}' shows ROS programs what its hub runs, and has been opened without one"
            )
        from devices.ros.zenoh.transport import ZenohTransport  # it needs the extra

        return ZenohTransport(self._connect, self._domain)
