"""The ROS 2 messages that ports carry, as pydantic models: standard types, CRTK's and Trocar's own.

    from trocar.messages import Float64Message

    Float64Message(data=1.5)

Numbers are in SI units, quaternions are (x, y, z, w), `header.frame_id` names the frame and `header.stamp` is
in the clock of the port. A value that is not finite or has the wrong shape raises pydantic's ValidationError.
"""

from schemas import crtk, ros, trocar_msgs
from schemas.crtk import *  # noqa: F403  (its __all__)
from schemas.message import Message
from schemas.ros import *  # noqa: F403
from schemas.trocar_msgs import *  # noqa: F403
from schemas.visualization import (
    ColorRGBA,
    DurationMessage,
    Marker,
    MarkerArray,
    MeshFile,
    UVCoordinate,
)

__all__ = [
    "ColorRGBA",
    "DurationMessage",
    "Marker",
    "MarkerArray",
    "MeshFile",
    "Message",
    "UVCoordinate",
]
__all__ += crtk.__all__
__all__ += ros.__all__
__all__ += trocar_msgs.__all__
