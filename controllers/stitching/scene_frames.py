"""The frames of a scene for picked points, under the names of /tf. SI units.

A point may also be a pixel of the endoscope's pictures, in the frame `<camera>_left_image` or
`<camera>_right_image`: x to the right and y down from the middle of the first pixel. The pixel means the
point of the pad under it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from controllers.motion.frames import base_in_world
from controllers.stitching.params import StitchParams
from hub.participant import Inputs, signal_in
from robots.dvrk import crtk
from robots.dvrk.ecm import tip
from robots.dvrk.endoscope import EYES, Eye, StereoCamera, optical_in_roll
from robots.dvrk.mounted.mounted_ecm import MountedEcm
from robots.transform import inverse_transform, pose_to_matrix, translation
from schemas.errors import MotionError, did_you_mean
from schemas.ports import Port
from schemas.ros import PointStamped, PoseStamped
from schemas.vectors import Vector

__all__ = ["SceneFrames"]


class SceneFrames:
    """Poses of the frames: the fixed ones, the tips of the arms, the camera and the needle."""

    def __init__(self, params: StitchParams, name: str, camera: StereoCamera) -> None:
        """Create the frames; `name`: the endoscope; `camera`: the stereo camera."""
        self._bases = {arm: base_in_world(arm, params) for arm in params.arms.present_arms}
        self._fixed = {crtk.WORLD_FRAME: np.eye(4)}
        if params.mounting == "cart":
            self._fixed[crtk.CART_FRAME] = np.eye(4)
        self._fixed |= {crtk.base_frame(arm): base for arm, base in self._bases.items()}
        self._fixed |= {name: fixture.pose for name, fixture in params.fixtures.items()}
        self._needle, self._optical = params.needle[0], f"{name}_left_optical"
        ecm = params.arms.present_arms.get("ECM")
        self._left = _left_in_tip(ecm, camera.baseline) if isinstance(ecm, MountedEcm) else None
        self._camera, self._skin = camera, params.phantom.pose
        self._pictures: dict[str, Eye] = (
            {} if self._left is None else {f"{name}_{eye}_image": eye for eye in EYES}
        )
        self.others = tuple(arm for arm in self._bases if arm not in (params.driver, params.puller))
        """Arms without a part in the stitch; their tips are measured all the same."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of all frames."""
        camera = () if self._left is None else (self._optical,)
        return (*self._fixed, *self._bases, *camera, *self._pictures, self._needle)

    @property
    def ports(self) -> Iterator[Port]:
        """The measured tips of the arms that do not stitch."""
        for arm in self.others:
            yield signal_in(f"{arm}/local/measured_cp", PoseStamped, frame=crtk.base_frame(arm))

    def in_world(self, picked: PointStamped, inputs: Inputs) -> Vector:
        """Return a point in the world, shape (3,).

        Raises MotionError for an unknown frame, or for a pixel without a pad.
        """
        point = picked.point
        if (eye := self._pictures.get(picked.header.frame_id)) is not None:
            return self._point_under_pixel(
                eye, np.array([point.x, point.y]), self._pose(self._optical, inputs)
            )
        return (self._pose(picked.header.frame_id, inputs) @ [point.x, point.y, point.z, 1.0])[:3]

    def _point_under_pixel(self, eye: Eye, pixel: Vector, left: Vector) -> Vector:
        """Return the point of the skin's plane under a pixel of an eye, m, shape (3,), in the world.

        `left` is the left camera's optical frame in the world, shape (4, 4).
        """
        size = self._camera.width, self._camera.height
        if not ((pixel >= -0.5) & (pixel < np.array(size) - 0.5)).all():
            raise MotionError(f"pixel {pixel.tolist()} is not in a picture of {size[0]} x {size[1]} pixels")
        projection = self._camera.projection(eye)
        ahead = np.linalg.solve(projection[:, :3], [*pixel, 1.0])
        start = -np.linalg.solve(projection[:, :3], projection[:, 3])
        from_skin = inverse_transform(self._skin) @ left
        origin, ray = from_skin[:3, :3] @ start + from_skin[:3, 3], from_skin[:3, :3] @ ahead
        if origin[2] * ray[2] >= 0.0:
            raise MotionError(f"pixel {pixel.tolist()} of the {eye} eye does not look at the pad")
        return (self._skin @ [*(origin - ray * origin[2] / ray[2]), 1.0])[:3]

    def _pose(self, frame: str, inputs: Inputs) -> Vector:
        if (fixed := self._fixed.get(frame)) is not None:
            return fixed
        if frame in self._bases:
            return self._bases[frame] @ pose_to_matrix(inputs[f"{frame}/local/measured_cp"])
        if frame == self._needle:
            return pose_to_matrix(inputs[f"objects/{frame}/pose"])
        if self._left is not None and frame == self._optical:
            return self._pose("ECM", inputs) @ self._left
        raise MotionError(
            f"frame_id '{frame}' is no frame of this scene; allowed: {', '.join(self.names)}"
            f".{did_you_mean(frame, self.names)}"
        )


def _left_in_tip(arm: MountedEcm, baseline: float) -> Vector:
    """Return the left camera's optical frame in the ECM's tip frame, shape (4, 4), as on /tf."""
    left = translation(-0.5 * baseline, 0.0, 0.0)
    return inverse_transform(tip(arm.endoscope, arm.tip_frame)) @ optical_in_roll(arm.endoscope) @ left
