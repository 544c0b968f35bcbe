"""The frames of a scene in which markers may be, under the names of /tf, and their poses in its model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from engines.mujoco.params import SceneParams
from robots.dvrk.crtk import CART_FRAME, WORLD_FRAME
from robots.dvrk.ecm import tip
from robots.dvrk.endoscope import BASELINE, optical_in_roll
from robots.dvrk.mounted.mounted_ecm import MountedEcm
from robots.transform import inverse_transform, translation
from schemas.errors import SessionError
from schemas.vectors import Vector

if TYPE_CHECKING:
    import mujoco

__all__ = ["SceneFrames", "frame_names"]

_OPTICAL = "_left_optical"


def frame_names(scene: SceneParams, cameras: Sequence[str]) -> tuple[str, ...]:
    """Return the names of all frames: those that never move first.

    `world` and, on a cart, `Cart`, which is the same; `<arm>_base`, an arm's remote centre of motion;
    fixtures; `<arm>`, its tip; `<camera>_left_optical` of each of `cameras`, if there is an ECM; objects.
    """
    return (*_fixed_frames(scene), *scene.arms, *_optical(scene, cameras), *scene.objects)


def _fixed_frames(scene: SceneParams) -> tuple[str, ...]:
    roots = (WORLD_FRAME, CART_FRAME) if scene.mounting == "cart" else (WORLD_FRAME,)
    return (*roots, *(f"{arm}_base" for arm in scene.arms), *scene.fixtures)


def _optical(scene: SceneParams, cameras: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"{camera}{_OPTICAL}" for camera in cameras) if "ECM" in scene.arms else ()


class SceneFrames:
    """Where the frames of a scene are in a state of its model."""

    def __init__(self, scene: SceneParams, model: mujoco.MjModel) -> None:
        """`model`: made of `scene`."""
        from engines.mujoco.model.seats import arm_tips  # the kind can be described without MuJoCo

        self.fixed = frozenset(_fixed_frames(scene))
        """Those that never move."""
        self._site = {f"{arm}_base": model.site(f"{arm}/base").id for arm in scene.arms}
        tips = {arm: arm_tips(params.by_owner(arm), model) for arm, params in scene.arms.items()}
        self._tips = {arm: found for arm, found in tips.items() if len(found) > 1}
        self._site |= {arm: found[0].site for arm, found in tips.items()}
        self._body = {name: model.body(name).id for name in (*scene.fixtures, *scene.objects)}
        ecm = scene.arms.get("ECM")
        self._left = _left_in_tip(ecm) if isinstance(ecm, MountedEcm) else None

    def pose(self, frame: str, data: mujoco.MjData) -> Vector:
        """Return the pose of `frame` in the world, shape (4, 4), from `data` with kinematics up to date.

        Raises SessionError if there is no such frame.
        """
        if frame in (WORLD_FRAME, CART_FRAME):
            return np.eye(4)
        if self._left is not None and frame.endswith(_OPTICAL):
            return self.pose("ECM", data) @ self._left
        pose = np.eye(4)
        if frame in self._tips:
            self._site[frame] = next(tip.site for tip in self._tips[frame] if tip.is_engaged(data))
        if (site := self._site.get(frame)) is not None:
            pose[:3, :3], pose[:3, 3] = data.site_xmat[site].reshape(3, 3), data.site_xpos[site]
        elif (body := self._body.get(frame)) is not None:
            pose[:3, :3], pose[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
        else:
            raise SessionError(
                f"a marker is in frame '{frame}', which this scene does not have: state the same arms,"
                " fixtures and objects for markers and cameras"
            )
        return pose


def _left_in_tip(arm: MountedEcm) -> Vector:
    """Return the left camera's optical frame in that of the ECM's tip, shape (4, 4), as on /tf."""
    left = translation(-0.5 * BASELINE, 0.0, 0.0)
    return inverse_transform(tip(arm.endoscope, arm.tip_frame)) @ optical_in_roll(arm.endoscope) @ left
