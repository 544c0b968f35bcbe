"""Changes of the devices' network links while a session runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import zenoh
from pydantic import BaseModel, ConfigDict, Field

from hub.devices.network_link import NetworkLink, NetworkLinkOrder, describe_link
from hub.transport.run_connection import RunConnection
from schemas.codec import encode
from schemas.errors import MessageError, did_you_mean
from schemas.network_link import NetworkLinkSpec, Preset
from schemas.quantity import Duration
from schemas.ros import StringMessage

__all__ = ["NetworkLinkControl", "NetworkLinkReply", "NetworkLinkRequest"]


class NetworkLinkRequest(BaseModel):
    """Change the network link of a device; omitted fields stay unchanged.

    A preset replaces a delay, and a delay replaces a preset.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    device: str
    preset: Preset | None = None
    delay: Duration | None = None
    jitter: Duration | None = None
    loss: float | None = None
    outage: Duration = Field(default=0, ge=0)
    """Lose every message for this long from now on."""


class NetworkLinkReply(BaseModel):
    """The network link of a device from now on."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    device: str
    link: NetworkLinkSpec
    description: str
    """The same in words; empty without delay and loss."""


class NetworkLinkControl:
    """Knows the network link of every device, and orders changes in the device's process.

    `simulated` are the links of the devices in simulated time; orders to all other links are published.
    """

    def __init__(self, run: RunConnection, simulated: Mapping[str, NetworkLink]) -> None:
        self._specs = {
            planned.name: planned.network_link or NetworkLinkSpec()
            for planned in run.plan.participants.values()
            if planned.role == "device"
        }
        self._simulated = simulated
        away = [name for name in self._specs if name not in simulated]
        block, cdr = zenoh.CongestionControl.BLOCK, zenoh.Encoding.APPLICATION_CDR
        self._publishers = {
            name: run.session.declare_publisher(run.keys.link(name), encoding=cdr, congestion_control=block)
            for name in away
        }
        self._changed: set[str] = set()

    def change_link(self, request: NetworkLinkRequest) -> NetworkLinkReply:
        """Change a link.

        Raises MessageError if the device does not exist, ValueError if the link would be invalid.
        """
        name = request.device
        if name not in self._specs:
            raise MessageError(f"there is no device '{name}'.{did_you_mean(name, self._specs)}")
        given: dict[str, Any] = request.model_dump(
            mode="json", exclude={"device", "outage"}, exclude_none=True
        )
        replaced = {"preset": None, "delay": 0} if given.keys() & {"preset", "delay"} else {}
        self._specs[name] = NetworkLinkSpec.model_validate(
            self._specs[name].model_dump(mode="json") | replaced | given
        )
        self._order(name, request.outage)
        return NetworkLinkReply(
            device=name,
            link=self._specs[name],
            description=describe_link(self._specs[name], outage_ns=request.outage),
        )

    def repeat(self, device: str) -> None:
        """Publish the changed link again, for a device after its host has joined again."""
        if device in self._changed:
            self._order(device, 0)

    def _order(self, name: str, outage_ns: int) -> None:
        order = NetworkLinkOrder(spec=self._specs[name], outage_ns=outage_ns)
        self._changed.add(name)
        if name in self._simulated:
            self._simulated[name].order(order)
        else:
            self._publishers[name].put(encode(StringMessage(data=order.model_dump_json())))

    def undeclare(self) -> None:
        """Publish no more."""
        for publisher in self._publishers.values():
            publisher.undeclare()
