"""One row of the table from which every gateway makes its publishers, subscribers, services and ports."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from schemas.ports import Port

__all__ = ["Row", "Way"]

_PICTURES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")

Way = Literal["publish", "subscribe", "serve"]


@dataclass(frozen=True, slots=True)
class Row:
    """One topic or service, seen from the gateway."""

    topic: str
    """Absolute name: `/PSM1/measured_js`."""
    type: str
    """ROS 2 type: `sensor_msgs/msg/JointState`, `crtk_msgs/srv/QueryForwardKinematics`."""
    way: Way
    """`publish`: what the simulation tells; `subscribe`: what ROS programs say; `serve`: what they ask."""
    port: Port | None = None
    """The port behind it: an input if published, an output if subscribed to.

    None: the gateway itself makes or answers it.
    """
    latched: bool = False
    """Late joiners get the last message."""
    periodic: bool = False
    """Published at the gateway's period, the newest value each time; otherwise once for every message, at
    once.
    """
    owner: str = ""
    """The arm, console part or camera that it belongs to, on whose `warning` and `error` its bad input is
    told: `PSM1`, `SUJ/PSM1`.
    """

    is_real: bool = False
    """Whether it is of a real arm or pedal, that is listened to."""

    @property
    def is_picture(self) -> bool:
        """Whether its messages are pictures, far larger than all others."""
        return self.type in _PICTURES

    @property
    def name(self) -> str:
        """What is left of the topic without its owner: `measured_js`, `jaw/servo_jp`."""
        return self.topic.rpartition(f"/{self.owner}/")[2] if self.owner else self.topic[1:]

    @property
    def leads(self) -> bool:
        """Say whether it moves an arm: such commands are heeded from one program at a time."""
        return self.way == "subscribe" and self.name.rpartition("/")[2].startswith(("servo_", "move_"))
