"""The ports of visual servoing: pictures and the ECM's state in; its command, and what is seen, out."""

from __future__ import annotations

from controllers.ports import CAMERA, camera_inputs, measured_joints
from controllers.visual_servoing.params import ServoingParams
from hub.participant import event_in, event_out, signal_out
from robots.dvrk import crtk, ecm
from schemas.crtk import OperatingState
from schemas.ports import Port
from schemas.ros import (
    Float64Message,
    Float64MultiArray,
    JointState,
    PoseStamped,
    StringMessage,
    TwistStamped,
)

__all__ = ["servoing_ports"]


def servoing_ports(params: ServoingParams) -> tuple[Port, ...]:
    """Return all ports."""
    names, command = ecm.JOINT_NAMES, crtk.MEASURED[:2]
    return (
        *camera_inputs(
            ("left",),
            "rgb8 or bgr8; it steers, so it is an input in simulated time",
            "of a rectified picture",
        ),
        event_in(
            "goal",
            Float64MultiArray,
            "four times x and y, normalised: where the discs should be from now on",
        ),
        event_in("operating_state", OperatingState, "of the ECM; unconnected: ready"),
        measured_joints(
            "measured_js",
            names,
            "of the ECM; read at the start and whenever the arm becomes ready",
            start=params.start,
        ),
        signal_out("servo_jp", JointState, "command to the ECM", names=names, fields=command),
        signal_out(
            "camera_velocity", TwistStamped, "of the left camera, which the command gives it", frame=CAMERA
        ),
        _corners("features", "where the discs were seen last, in their order: x and y, 0 before"),
        _corners("features_goal", "where they should be"),
        signal_out(
            "feature_error",
            Float64Message,
            "largest distance of a disc, as seen last, from its place",
            unit="px",
        ),
        signal_out(
            "target/measured_cp",
            PoseStamped,
            "pose of the target as seen last; its z axis points away from the camera",
            frame=CAMERA,
        ),
        event_out(
            "state",
            StringMessage,
            "whenever it changes: waiting (for the arm), blind, searching, moving, reached, settled",
        ),
        event_out("warning", StringMessage, "an input that is refused, and a goal that cannot be reached"),
    )


def _corners(name: str, description: str) -> Port:
    return signal_out(name, Float64MultiArray, description, size=8, shape=(4, 2), unit="px")
