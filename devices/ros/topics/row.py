"""A row of the table of topics, the source of every gateway's publishers, subscribers, services and ports."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from schemas.ports import Port
from schemas.ros import CompressedImage, Image

__all__ = ["Row", "Way"]

_PICTURES = (Image.ros_type, CompressedImage.ros_type)

Way = Literal["publish", "subscribe", "serve"]


@dataclass(frozen=True, slots=True)
class Row:
    """A topic or service, seen from the gateway."""

    topic: str
    """Absolute name: `/PSM1/measured_js`."""
    type: str
    """ROS 2 type: `sensor_msgs/msg/JointState`, `crtk_msgs/srv/QueryForwardKinematics`."""
    way: Way
    """`publish`: from the simulation; `subscribe`: from ROS programs; `serve`: a service for programs."""
    port: Port | None = None
    """Port of the row: an input if published, an output if subscribed to.

    None: the gateway itself publishes or serves the row.
    """
    latched: bool = False
    """Late joiners get the last message."""
    periodic: bool = False
    """Published at the gateway's period, the newest value each time; otherwise once per message, at once."""
    owner: str = ""
    """Arm, console part or camera of the row: `PSM1`, `SUJ/PSM1`.

    The owner's `warning` and `error` report refusals on this row.
    """

    is_real: bool = False
    """Whether the owner is a real arm or pedal."""

    @property
    def is_picture(self) -> bool:
        """Whether the messages are pictures, far larger than all others."""
        return self.type in _PICTURES

    @property
    def name(self) -> str:
        """The topic without the owner: `measured_js`, `jaw/servo_jp`."""
        return self.topic.rpartition(f"/{self.owner}/")[2] if self.owner else self.topic[1:]

    @property
    def moves(self) -> bool:
        """Whether the row moves an arm: moves are accepted from a single program at a time."""
        return self.way == "subscribe" and self.name.rpartition("/")[2].startswith(("servo_", "move_"))
