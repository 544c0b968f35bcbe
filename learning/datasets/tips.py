"""Poses of instruments in the frame of the endoscope, computed from recorded joints.

The frame is that of dVRK's Cartesian ports: the endoscope's tip (`ECM`), or the world in a scene without an
endoscope.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from learning.datasets.columns import Columns, commanded_columns, measured_columns
from robots import rotation
from robots.dvrk import setup_joints
from robots.dvrk.crtk import CAMERA_FRAME, WORLD_FRAME
from robots.dvrk.mounted.mounted_arms import MountedArms
from robots.dvrk.mounted.mounted_psm import MountedPsm
from robots.transform import inverse_transform
from schemas.errors import RecordingError
from schemas.vectors import Vector
from trocar import Recording

__all__ = ["Tips"]

_CAMERA = "ECM"


class Tips:
    """The arms of a recording's scene, and the poses of their tips over time."""

    def __init__(self, recording: Recording) -> None:
        """Read the scene. Raises RecordingError if no participant of kind mujoco states arms."""
        self._recording = recording
        specs = recording.scenario().participants.values()
        params = next(
            (spec.params for spec in specs if spec.kind == "mujoco" and "arms" in spec.params), None
        )
        if params is None:
            raise RecordingError(f"'{recording.file}': no participant of kind mujoco with arms")
        try:
            self.arms: dict[Any, Any] = dict(TypeAdapter(MountedArms).validate_python(params["arms"]).items())
        except ValidationError as error:
            raise RecordingError(
                f"'{recording.file}': the arms of the scene cannot be read: {error}"
            ) from error
        self.frame = CAMERA_FRAME if _CAMERA in self.arms else WORLD_FRAME
        """Frame of all poses."""
        self._bases = {arm: self._base(arm, params) for arm in self.arms}
        self._measured = _by_arm(measured_columns(recording))
        self._commanded = _by_arm(commanded_columns(recording))

    def _base(self, arm: Any, params: Mapping[str, Any]) -> Vector:
        """Return the pose of an arm's base in the world, shape (4, 4)."""
        if params.get("mounting", "free") == "free":
            return self.arms[arm].pose
        positions: Mapping[str, Any] = params.get("setup_joints") or {}
        stated = positions.get(arm)
        return setup_joints.base_pose(arm, np.array(stated or setup_joints.SIMULATED[arm], np.float64))

    @property
    def instruments(self) -> list[str]:
        """Arms with an instrument."""
        return [arm for arm, mounted in self.arms.items() if isinstance(mounted, MountedPsm)]

    def measured(self, arm: str) -> Columns:
        """Return the measured pose and jaw of an arm, eight numbers in a row."""
        return self._poses(arm, self._measured)

    def commanded(self, arm: str) -> Columns:
        """Return the set-point of pose and jaw of an arm, eight numbers in a row."""
        return self._poses(arm, self._commanded)

    def turn(self, arm: str, times_ns: NDArray[np.int64]) -> Vector:
        """Return the orientation of an arm's base in the frame, shape (n, 3, 3)."""
        return (self._from_world(times_ns) @ self._bases[arm])[..., :3, :3]

    def from_world(self, poses: Vector, times_ns: NDArray[np.int64]) -> Vector:
        """Return poses in the world, shape (n, 7), in the frame."""
        return _to_poses(self._from_world(times_ns) @ _to_matrices(poses))

    def _poses(self, arm: str, columns: dict[str, Columns]) -> Columns:
        if arm not in columns:
            raise RecordingError(f"'{self._recording.file}': joints of {arm} are not all recorded")
        joints, jaw = columns[arm], columns.get(f"{arm}.jaw")
        base = self._from_world(joints.times_ns) @ self._bases[arm]
        poses = _to_poses(base @ self.arms[arm].chain.forward(joints.values))
        opening = np.zeros((len(poses), 1)) if jaw is None else _newest(jaw, joints.times_ns)
        names = tuple(f"{arm}.{i}" for i in range(8))
        return Columns(joints.port, names, joints.times_ns, np.hstack([poses, opening[:, :1]]))

    def _from_world(self, times_ns: NDArray[np.int64]) -> Vector:
        """Return the world in the frame at each time, shape (n, 4, 4)."""
        if self.frame == WORLD_FRAME:
            return np.repeat(np.eye(4)[None], len(times_ns), axis=0)
        joints = _newest(self._measured[_CAMERA], times_ns)
        return inverse_transform(self._bases[_CAMERA] @ self.arms[_CAMERA].chain.forward(joints))


def _by_arm(found: list[Columns]) -> dict[str, Columns]:
    """Return columns by `PSM1` or `PSM1.jaw`."""
    by_arm: dict[str, Columns] = {}
    for one in found:
        arm, _, name = one.names[0].partition(".")
        part = f"{arm}.jaw" if name == "jaw" else f"{arm}.hand" if name.startswith("hand.") else arm
        by_arm[part] = one
    return by_arm


def _newest(columns: Columns, times_ns: NDArray[np.int64]) -> Vector:
    newest = np.searchsorted(columns.times_ns, times_ns, side="right") - 1
    return columns.values[newest.clip(min=0)]


def _to_matrices(poses: Vector) -> Vector:
    matrices = np.repeat(np.eye(4)[None], len(poses), axis=0)
    matrices[:, :3, 3] = poses[:, :3]
    matrices[:, :3, :3] = [rotation.matrix(q) for q in poses[:, 3:]]
    return matrices


def _to_poses(matrices: Vector) -> Vector:
    """Return poses, shape (n, 7), of matrices, with quaternions that do not jump in sign."""
    poses = np.hstack([matrices[:, :3, 3], rotation.from_matrices(matrices)])
    turns = poses[:, 3:]
    jumps = np.sum(turns[1:] * turns[:-1], axis=1) < 0.0
    turns[1:] *= np.where(np.cumsum(jumps) % 2, -1.0, 1.0)[:, None]
    return poses
