"""The hand's frame in the arm's: right, up and away on the desk as directions of the instrument.

Three frames: the *desk*, frame of a device's measurements (REP 103 for a user sitting at the desk: x away, y
left, z up); the *camera*, the ECM's tip frame, reference of `base_in_view`; and the *view*, the frame of the
surgeon's picture: x left, y up, z ahead (docs/decisions/0013). With `view: camera`

    R_base<-hand = R_camera<-base^T  R_camera<-view  R_view<-desk  R_desk<-hand,

so a motion to the right on the desk is a motion to the right in the picture; on the real system both
consoles' and arms' base frames are set to the same effect (jhu-dvrk/sawIntuitiveResearchKit,
mtsIntuitiveResearchKitSUJ.cpp: PSM base frames are in the camera's frame). The real masters publish their
poses in the display's frame, with the axes of the camera's frame: with `view: display`

    R_base<-hand = R_camera<-base^T  R_display<-hand.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from controllers.teleoperation.params import TeleoperationParams
from robots import rotation
from robots.dvrk import ecm
from schemas.vectors import Vector

__all__ = ["View"]

_DESK_IN_VIEW = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""Away (x) on the desk is ahead (z) in the view, left (y) is left (x), up (z) is up (y)."""


class View:
    """Turns the hand's frame into the arm's base frame."""

    def __init__(self, params: TeleoperationParams) -> None:
        self._registration = np.array(params.registration)
        self._hand_in_base, self._seen = self._registration, b""
        self._hand_in_camera: Vector | None = self._registration if params.view == "display" else None
        if params.view == "camera":
            # both in the roll link
            camera, view = (ecm.tip(params.endoscope, frame)[:3, :3] for frame in (params.tip_frame, "view"))
            self._hand_in_camera = rotation.product(
                rotation.from_matrix(camera.T @ view @ _DESK_IN_VIEW), self._registration
            )

    def hand_in_base(self, base_in_view: Vector) -> Vector:
        """Return the orientation of the hand's frame in the arm's base frame, quaternion (x, y, z, w).

        Args:
            base_in_view: pose (x, y, z, qx, qy, qz, qw) of the arm's base in the camera's frame; ignored with
                `view: base`.
        """
        if self._hand_in_camera is None:
            return self._registration
        if (seen := base_in_view.tobytes()) == self._seen:
            return self._hand_in_base
        self._seen = seen
        orientation = rotation.product(rotation.conjugate(base_in_view[3:]), self._hand_in_camera)
        self._hand_in_base = orientation / sqrt(orientation.dot(orientation))
        return self._hand_in_base
