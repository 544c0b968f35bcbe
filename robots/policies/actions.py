"""Layouts of actions: rows of a policy's numbers to goals of an arm, and back.

A goal in *tip* space has eight numbers: pose of the tip (m, quaternion x, y, z, w) and jaw opening (rad). A
goal in *joint* space has the arm's joint positions (rad or m) and the jaw opening.

| layout | numbers an arm | meaning |
|---|---|---|
| `open-h-dvrk` | 8 | set-point of the tip: position, quaternion, jaw (Open-H-Embodiment, dVRK of JHU) |
| `joint` | 7 | set-point of the joints, jaw |
| `cartesian-delta` | 7 | displacement, rotation vector, both from row to row along the frame's axes; jaw |
| `rel-xyz-rot6d` | 10 | position, two columns of the rotation in the observed tip's frame; jaw (GR00T-H) |
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar, Literal

import numpy as np

from robots import rotation
from robots.policies.fields import Field, Group, jaw_field, joint_fields, pose_fields
from robots.serial_chain import Joint
from robots.transform import inverse_transform, pose_to_matrix
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["ACTIONS", "ActionLayout", "ActionName", "Space"]

ActionName = Literal["open-h-dvrk", "joint", "cartesian-delta", "rel-xyz-rot6d"]
Space = Literal["tip", "joint"]
_SHORTEST = 0.1
"""Norm of a quaternion or of a column of a rotation below which no direction can be read."""


class ActionLayout(ABC):
    """A layout of the numbers of one arm in a row of actions."""

    space: ClassVar[Space] = "tip"

    @abstractmethod
    def groups(self, arm: str, frame: str, joints: Sequence[Joint]) -> tuple[Group, ...]:
        """Return the numbers of a row, by group; `frame` is the reference frame of the arm's poses."""

    @abstractmethod
    def decode(self, rows: Vector, tip: Vector) -> Vector:
        """Return the goals, shape (horizon, goal), of rows, shape (horizon, numbers).

        `tip` is the pose at the observation, shape (7,). Raises MotionError for numbers without a meaning.
        """

    @abstractmethod
    def encode(self, goals: Vector, tip: Vector) -> Vector:
        """Return the rows of goals: the inverse of `decode`."""


class AbsolutePose(ActionLayout):
    """Layout `open-h-dvrk`."""

    def groups(self, arm: str, frame: str, joints: Sequence[Joint]) -> tuple[Group, ...]:  # noqa: ARG002
        """Return pose and jaw."""
        name = arm.lower()
        return (
            Group(f"{name}_pose", pose_fields(f"{name}_sp", frame)),
            Group(f"{name}_gripper", jaw_field(f"{name}_jaw_sp")),
        )

    def decode(self, rows: Vector, tip: Vector) -> Vector:  # noqa: ARG002
        """Normalise the quaternions."""
        goals = rows.copy()
        goals[:, 3:7] = _normalise(rows[:, 3:7], "quaternion")
        return goals

    def encode(self, goals: Vector, tip: Vector) -> Vector:  # noqa: ARG002
        """Return a copy: a goal is a row."""
        return goals.copy()


class JointPositions(ActionLayout):
    """Layout `joint`."""

    space: ClassVar[Space] = "joint"

    def groups(self, arm: str, frame: str, joints: Sequence[Joint]) -> tuple[Group, ...]:  # noqa: ARG002
        """Return joints and jaw."""
        name = arm.lower()
        return (
            Group(f"{name}_joints", tuple(joint_fields(f"{name}_sp", joints))),
            Group(f"{name}_gripper", jaw_field(f"{name}_jaw_sp")),
        )

    def decode(self, rows: Vector, tip: Vector) -> Vector:  # noqa: ARG002
        """Return a copy: a row is a goal."""
        return rows.copy()

    def encode(self, goals: Vector, tip: Vector) -> Vector:  # noqa: ARG002
        """Return a copy: a goal is a row."""
        return goals.copy()


class CartesianDelta(ActionLayout):
    """Layout `cartesian-delta`: each row goes on from the row before, the first from the observed tip."""

    def groups(self, arm: str, frame: str, joints: Sequence[Joint]) -> tuple[Group, ...]:  # noqa: ARG002
        """Return displacement, rotation vector and jaw."""
        name = arm.lower()
        displacement = (Field(f"{name}_delta.position.{axis}", "m", frame) for axis in "xyz")
        turn = (Field(f"{name}_delta.rotation.{axis}", "rad", frame) for axis in "xyz")
        return (
            Group(f"{name}_delta", (*displacement, *turn)),
            Group(f"{name}_gripper", jaw_field(f"{name}_jaw_sp")),
        )

    def decode(self, rows: Vector, tip: Vector) -> Vector:
        """Add the rows up."""
        goals = np.empty((len(rows), 8))
        goals[:, :3] = tip[:3] + np.cumsum(rows[:, :3], axis=0)
        goals[:, 7] = rows[:, 6]
        orientation = tip[3:]
        for goal, turn in zip(goals, rows[:, 3:6], strict=True):
            orientation = rotation.product(rotation.exp(turn), orientation)
            goal[3:7] = orientation = orientation / np.linalg.norm(orientation)
        return goals

    def encode(self, goals: Vector, tip: Vector) -> Vector:
        """Return the differences of the goals."""
        before = np.vstack([tip, goals[:-1, :7]])
        rows = np.empty((len(goals), 7))
        rows[:, :3] = goals[:, :3] - before[:, :3]
        rows[:, 6] = goals[:, 7]
        for row, goal, earlier in zip(rows, goals, before, strict=True):
            row[3:6] = rotation.log(rotation.product(goal[3:7], rotation.conjugate(earlier[3:7])))
        return rows


class RelativePose6d(ActionLayout):
    """Layout `rel-xyz-rot6d`: rows in the frame of the observed tip; rotation r00 r10 r20 r01 r11 r21."""

    def groups(self, arm: str, frame: str, joints: Sequence[Joint]) -> tuple[Group, ...]:  # noqa: ARG002
        """Return pose and jaw."""
        name = arm.lower()
        tip = f"{arm}_tip at the observation"
        position = (Field(f"{name}_rel.position.{axis}", "m", tip) for axis in "xyz")
        entries = ("r00", "r10", "r20", "r01", "r11", "r21")
        turn = (Field(f"{name}_rel.rotation.{entry}", "", tip) for entry in entries)
        return (
            Group(f"{name}_pose", (*position, *turn)),
            Group(f"{name}_gripper", jaw_field(f"{name}_jaw_sp")),
        )

    def decode(self, rows: Vector, tip: Vector) -> Vector:
        """Compose with the observed tip; the two columns are made orthonormal by Gram and Schmidt."""
        first = _normalise(rows[:, 3:6], "first column of the rotation")
        second = rows[:, 6:9] - first * np.sum(first * rows[:, 6:9], axis=1, keepdims=True)
        second = _normalise(second, "second column of the rotation, across the first")
        matrices = np.zeros((len(rows), 4, 4))
        matrices[:, :3, 0], matrices[:, :3, 1] = first, second
        matrices[:, :3, 2] = np.cross(first, second)
        matrices[:, :3, 3], matrices[:, 3, 3] = rows[:, :3], 1.0
        poses = pose_to_matrix(tip) @ matrices
        return np.column_stack([poses[:, :3, 3], rotation.from_matrices(poses), rows[:, 9]])

    def encode(self, goals: Vector, tip: Vector) -> Vector:
        """Express the goals in the observed tip's frame."""
        back = inverse_transform(pose_to_matrix(tip))
        rows = np.empty((len(goals), 10))
        for row, goal in zip(rows, goals, strict=True):
            pose = back @ pose_to_matrix(goal[:7])
            row[:3], row[3:6], row[6:9], row[9] = pose[:3, 3], pose[:3, 0], pose[:3, 1], goal[7]
        return rows


def _normalise(vectors: Vector, what: str) -> Vector:
    """Return unit vectors, shape (n, m); raises MotionError for a vector that is nearly 0."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    if lengths.size and lengths.min() < _SHORTEST:
        row = int(lengths.argmin())
        raise MotionError(
            f"row {row}: the {what} has length {lengths[row, 0]:.3g}, expected 1: no direction can be read"
        )
    return vectors / lengths


ACTIONS: dict[ActionName, ActionLayout] = {
    "open-h-dvrk": AbsolutePose(),
    "joint": JointPositions(),
    "cartesian-delta": CartesianDelta(),
    "rel-xyz-rot6d": RelativePose6d(),
}
"""All layouts, by name."""
