"""Ports that several controllers have: joints and state of an arm, pictures of a camera."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from hub.participant import event_in, signal_in
from robots.dvrk import crtk
from schemas.ports import Port
from schemas.ros import CameraInfo, Image, JointState

__all__ = ["CAMERA", "NO_POSE", "NO_TWIST", "NO_WRENCH", "camera_inputs", "measured_joints"]

CAMERA = "left_optical"
"""`frame_id` of the left camera: x right, y down, z ahead."""
NO_POSE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
NO_TWIST = NO_WRENCH = (0.0,) * 6


def measured_joints(
    name: str,
    joints: tuple[str, ...],
    description: str = "",
    *,
    start: tuple[float, ...] | None = None,
    max_age_ns: int = 0,
) -> Port:
    """Return an input of positions, velocities and efforts.

    Args:
        name: port name, such as `ECM/measured_js`.
        joints: joint names.
        description: port description.
        start: values while nothing is connected, positions first; the rest are 0. None: must be connected.
        max_age_ns: age at which the sample of a device is stale; 0: never.
    """
    if start is not None:
        start += (0.0,) * (len(crtk.MEASURED) * len(joints) - len(start))
    fields = crtk.MEASURED
    return signal_in(
        name, JointState, description, names=joints, fields=fields, start=start, max_age_ns=max_age_ns
    )


def camera_inputs(eyes: Iterable[str], picture: str, calibration: str) -> Iterator[Port]:
    """Yield the picture input of each eye, then its camera_info input, with these descriptions."""
    eyes = tuple(eyes)
    yield from (event_in(f"{eye}/image_raw", Image, picture) for eye in eyes)
    yield from (event_in(f"{eye}/camera_info", CameraInfo, calibration) for eye in eyes)
