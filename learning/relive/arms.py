"""Where the arms of a scenario stand beside its endoscope, and the joints at which tips have given poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from robots import rotation
from robots.dvrk import setup_joints
from robots.dvrk.crtk import CAMERA_FRAME, WORLD_FRAME
from robots.dvrk.inverse import inverse
from robots.transform import inverse_transform, pose_to_matrix
from schemas.errors import MotionError, ScenarioError
from schemas.vectors import Vector

__all__ = ["PlacedArm", "Way", "placed_arms"]


@dataclass(frozen=True)
class Way:
    """Set-points of an arm as joints; where a pose cannot be reached the arm stays."""

    joints: Vector
    """Shape (n, joints), rad or m."""
    jaw: Vector
    """Shape (n,), rad."""
    reached: Vector
    """Whether the pose of each frame is in reach, shape (n,)."""
    refusal: str
    """The first refusal, in words; empty: all frames are in reach."""

    @property
    def share(self) -> float:
        """Share of the frames in reach."""
        return float(self.reached.mean()) if len(self.reached) else 0.0


@dataclass(frozen=True)
class PlacedArm:
    """An arm of a scene."""

    name: str
    mounted: Any
    base: Vector
    """Pose of the arm's base in the reference frame of the set-points, shape (4, 4)."""

    def tip(self, joints: Vector) -> Vector:
        """Return positions of the tip in the reference frame, shape (n, 3)."""
        return (self.base @ self.mounted.chain.forward(joints))[..., :3, 3]

    def way(self, set_points: Vector) -> Way:
        """Return the joints of set-points, shape (n, 8)."""
        chain, back = self.mounted.chain, inverse_transform(self.base)
        near = np.array(self.mounted.start, np.float64)
        joints, reached, refusal = np.empty((len(set_points), len(near))), np.zeros(len(set_points)), ""
        for i, row in enumerate(set_points):
            try:
                near = inverse(chain, back @ pose_to_matrix(row[:7]), near)
                reached[i] = 1.0
            except MotionError as error:
                refusal = refusal or f"frame {i}: {error}"
            joints[i] = near
        return Way(joints, set_points[:, 7].copy(), reached, refusal)


def placed_arms(params: Any, names: tuple[str, ...], frame: str) -> Mapping[str, PlacedArm]:
    """Return arms of a robot's parameters; set-points are in `frame`: `ECM`, `world` or `base`.

    Raises ScenarioError if the scene lacks an arm, or the endoscope that is the reference.
    """
    needed = [*names, *((CAMERA_FRAME,) if frame == CAMERA_FRAME else ())]
    if missing := [name for name in needed if name not in params.arms]:
        raise ScenarioError(f"the scene has no {', '.join(missing)}: name another with --scenario")

    def base_of(name: Any) -> Vector:
        if params.mounting == "free":
            return params.arms[name].pose
        stated = params.setup_joints.get(name)
        return setup_joints.base_pose(name, np.array(stated or setup_joints.SIMULATED[name]))

    reference = np.eye(4)
    if frame == CAMERA_FRAME:
        ecm = params.arms[CAMERA_FRAME]
        reference = base_of(CAMERA_FRAME) @ ecm.chain.forward(np.array(ecm.start, np.float64))
    placed: dict[str, PlacedArm] = {}
    for name in names:
        known = frame in (CAMERA_FRAME, WORLD_FRAME)
        base = inverse_transform(reference) @ base_of(name) if known else np.eye(4)
        placed[name] = PlacedArm(name, params.arms[name], base)
    return placed


def angles_between(a: Vector, b: Vector) -> Vector:
    """Return the angles, rad, between quaternions, shape (n, 4)."""
    turns = (rotation.product(one, rotation.conjugate(other)) for one, other in zip(a, b, strict=True))
    return np.array([2.0 * np.arccos(min(1.0, abs(float(turn[3])))) for turn in turns])
