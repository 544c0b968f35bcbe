"""The ports of the needle tracker: both eyes' pictures and the arms' joints in; the needle's pose out."""

from __future__ import annotations

from functools import partial

from controllers.needle_tracker.params import TrackerParams
from robots.dvrk import crtk, ecm
from robots.dvrk.endoscope import EYES
from schemas.ports import Port
from schemas.ros import (
    CameraInfo,
    Float64Message,
    Float64MultiArray,
    Image,
    JointState,
    PoseStamped,
    PoseWithCovarianceStamped,
    StringMessage,
)

__all__ = ["CAMERA", "tracker_ports"]

CAMERA = "left_optical"
"""`frame_id` of the left camera: x right, y down, z ahead."""


def tracker_ports(params: TrackerParams) -> tuple[Port, ...]:
    """Return all ports."""
    came = partial(Port, causality="input", variability="event")
    goes = partial(Port, causality="output")
    joints = partial(Port, causality="input", type=JointState.ros_type, fields=crtk.MEASURED)
    arm, base = params.arm, crtk.base_frame(params.arm)
    held = tuple(joint.name for joint in params.holder.chain.joints)
    eyes = EYES if params.eyes == "both" else EYES[:1]
    return (
        *(
            came(name=f"{eye}/image_raw", type=Image.ros_type, description="rgb8 or bgr8, rectified")
            for eye in eyes
        ),
        *(
            came(name=f"{eye}/camera_info", type=CameraInfo.ros_type, description="its projection P is used")
            for eye in eyes
        ),
        joints(name=f"{arm}/measured_js", names=held, description="of the arm that holds the needle"),
        joints(
            name="ECM/measured_js", names=ecm.JOINT_NAMES, description="of the arm that holds the cameras"
        ),
        goes(
            name="kalmanOutput",
            type=PoseStamped.ros_type,
            frame=base,
            description="the needle, as the authors' filter publishes it: their RCM_PSM1 is the arm's base",
        ),
        goes(
            name="Tcn_hat",
            type=Float64MultiArray.ros_type,
            size=12,
            shape=(3, 4),
            description="the needle in the frame of the left camera, rows of the matrix, as theirs does",
        ),
        goes(
            name="pose_with_covariance",
            type=PoseWithCovarianceStamped.ros_type,
            variability="event",
            description=f"the needle in {base}, at every step",
        ),
        goes(
            name="covariance",
            type=Float64MultiArray.ros_type,
            size=36,
            shape=(6, 6),
            description="of displacement (m) and rotation (rad) along the axes of the needle's own frame",
        ),
        goes(
            name="seen_share",
            type=Float64Message.ros_type,
            description="of the wire, in its place in the newest picture",
        ),
        goes(name="slips", type=Float64Message.ros_type, description="how often it was found elsewhere"),
        goes(
            name="state",
            type=StringMessage.ros_type,
            variability="event",
            description="whenever it changes: blind (no picture), predicting (not seen), tracking",
        ),
        goes(
            name="warning",
            type=StringMessage.ros_type,
            variability="event",
            description="a picture that is refused, and a slip",
        ),
        *(
            (
                goes(
                    name="overlay/image_raw",
                    type=Image.ros_type,
                    variability="event",
                    frame=CAMERA,
                    description="the left picture with the region, the seen wire and the estimate",
                ),
            )
            if params.overlay
            else ()
        ),
    )
