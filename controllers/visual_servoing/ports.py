"""The ports of visual servoing: pictures and the ECM's state in; its command, and what is seen, out."""

from __future__ import annotations

from functools import partial

from controllers.visual_servoing.params import ServoingParams
from robots.dvrk import crtk, ecm
from schemas.crtk import OperatingState
from schemas.ports import Port
from schemas.ros import (
    CameraInfo,
    Float64Message,
    Float64MultiArray,
    Image,
    JointState,
    PoseStamped,
    StringMessage,
    TwistStamped,
)

__all__ = ["CAMERA", "servoing_ports"]

CAMERA = "left_optical"
"""`frame_id` of what is expressed in the frame of the left camera: x right, y down, z ahead."""


def servoing_ports(params: ServoingParams) -> tuple[Port, ...]:
    """Return all ports."""
    names = ecm.JOINT_NAMES
    came = partial(Port, causality="input", variability="event")
    goes = partial(Port, causality="output")
    corners = partial(Port, type=Float64MultiArray.ros_type, size=8, shape=(4, 2))
    return (
        came(
            name="left/image_raw",
            type=Image.ros_type,
            description="rgb8 or bgr8; it steers, so it is an input in simulated time",
        ),
        came(name="left/camera_info", type=CameraInfo.ros_type, description="of a rectified picture"),
        came(
            name="goal",
            type=Float64MultiArray.ros_type,
            description="four times x and y, normalised: where the discs should be from now on",
        ),
        came(
            name="operating_state",
            type=OperatingState.ros_type,
            description="of the ECM; unconnected: ready",
        ),
        Port(
            name="measured_js",
            causality="input",
            type=JointState.ros_type,
            names=names,
            fields=crtk.MEASURED,
            start=params.start + (0.0,) * (2 * len(names)),
            description="of the ECM; read at the start and whenever the arm becomes ready",
        ),
        goes(
            name="servo_jp",
            type=JointState.ros_type,
            names=names,
            fields=("position", "velocity"),
            description="command to the ECM",
        ),
        goes(
            name="camera_velocity",
            type=TwistStamped.ros_type,
            frame=CAMERA,
            description="of the left camera, which the command gives it",
        ),
        corners(
            name="features",
            causality="output",
            unit="px",
            description="where the discs were seen last, in their order: x and y, 0 before",
        ),
        corners(name="features_goal", causality="output", unit="px", description="where they should be"),
        goes(
            name="feature_error",
            type=Float64Message.ros_type,
            unit="px",
            description="largest distance of a disc, as seen last, from its place",
        ),
        goes(
            name="target/measured_cp",
            type=PoseStamped.ros_type,
            frame=CAMERA,
            description="pose of the target as seen last; its z axis points away from the camera",
        ),
        goes(
            name="state",
            type=StringMessage.ros_type,
            variability="event",
            description=(
                "whenever it changes: waiting (for the arm), blind, searching, moving, reached, settled"
            ),
        ),
        goes(
            name="warning",
            type=StringMessage.ros_type,
            variability="event",
            description="an input that is refused, and a goal that cannot be reached",
        ),
    )
