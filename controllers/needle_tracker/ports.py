"""The ports of the needle tracker: both eyes' pictures and the arms' joints in; the needle's pose out."""

from __future__ import annotations

from controllers.needle_tracker.params import TrackerParams
from controllers.ports import CAMERA, camera_inputs, measured_joints
from hub.participant import event_out, signal_out
from robots.dvrk import crtk, ecm
from robots.dvrk.endoscope import EYES
from schemas.ports import Port
from schemas.ros import (
    Float64Message,
    Float64MultiArray,
    Image,
    PoseStamped,
    PoseWithCovarianceStamped,
    StringMessage,
)

__all__ = ["tracker_ports"]


def tracker_ports(params: TrackerParams) -> tuple[Port, ...]:
    """Return all ports."""
    arm, base = params.arm, crtk.base_frame(params.arm)
    held = tuple(joint.name for joint in params.holder.chain.joints)
    eyes = EYES if params.eyes == "both" else EYES[:1]
    return (
        *camera_inputs(eyes, "rgb8 or bgr8, rectified", "its projection P is used"),
        measured_joints(f"{arm}/measured_js", held, "of the arm that holds the needle"),
        measured_joints("ECM/measured_js", ecm.JOINT_NAMES, "of the arm that holds the cameras"),
        signal_out(
            "kalmanOutput",
            PoseStamped,
            "the needle, as the authors' filter publishes it: their RCM_PSM1 is the arm's base",
            frame=base,
        ),
        signal_out(
            "Tcn_hat",
            Float64MultiArray,
            "the needle in the frame of the left camera, rows of the matrix, as theirs does",
            size=12,
            shape=(3, 4),
        ),
        event_out("pose_with_covariance", PoseWithCovarianceStamped, f"the needle in {base}, at every step"),
        signal_out(
            "covariance",
            Float64MultiArray,
            "of displacement (m) and rotation (rad) along the axes of the needle's own frame",
            size=36,
            shape=(6, 6),
        ),
        signal_out("seen_share", Float64Message, "of the wire, in its place in the newest picture"),
        signal_out("slips", Float64Message, "how often it was found elsewhere"),
        event_out(
            "state",
            StringMessage,
            "whenever it changes: blind (no picture), predicting (not seen), tracking",
        ),
        event_out("warning", StringMessage, "a picture that is refused, and a slip"),
        *((_overlay_port(),) if params.overlay else ()),
    )


def _overlay_port() -> Port:
    meaning = "the left picture with the region, the seen wire and the estimate"
    return event_out("overlay/image_raw", Image, meaning, frame=CAMERA)
