"""The world of a task at an instant, read from the task's inputs."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass, field
from typing import cast

import numpy as np
from numpy.typing import NDArray

from hub.participant import Inputs
from robots.dvrk import setup_joints
from robots.dvrk.mounted.mounted_ecm import MountedEcm
from robots.dvrk.setup_joints import CartArm
from robots.transform import pose_to_matrix
from schemas.ros import BoolMessage
from schemas.vectors import Vector
from tasks.params import TaskParams
from tasks.view import Frustum, optical_in_tip

__all__ = ["Instant", "Reader", "Watched", "base_pose"]


@dataclass(frozen=True)
class Watched:
    """Watched arms (with instruments) and objects of a task, and their connected inputs."""

    arms: tuple[str, ...]
    things: tuple[str, ...]
    forces: tuple[bool, ...]
    """Whether the force on each arm's instrument is connected."""
    hands: tuple[bool, ...]
    """Whether each arm's teleoperation is connected."""
    tools: bool
    """Whether the impulse between instruments is."""
    fixtures: bool | None
    """Whether the impulse between instruments and fixtures is connected; None: no fixtures in the scene."""
    camera: bool
    """Whether there is an endoscope with a connected pose."""


@dataclass
class Instant:
    """The world at an instant: m arms with instruments, n objects, all in the world's frame.

    The arrays are written anew at each instant.
    """

    arms: int
    things: int
    time_s: float = 0.0
    period_s: float = 0.0
    """Since the instant before."""
    tips: Vector = field(init=False)
    """Positions, m, shape (m, 3)."""
    turns: Vector = field(init=False)
    """Orientations in the arms' own bases: quaternions (x, y, z, w), shape (m, 4)."""
    velocities: Vector = field(init=False)
    """Velocities of the tips, m/s, shape (m, 3): see `tasks.metrics.smoothing`."""
    jerks: Vector = field(init=False)
    """Jerks of the tips, m/s^3, shape (m, 3)."""
    speeds: list[float] = field(init=False)
    """Speeds of the tips, m/s."""
    is_smooth: bool = False
    """Whether there are velocities and jerks already."""
    forces: list[float] = field(init=False)
    """On the instruments, N."""
    hands: list[tuple[bool, ...]] = field(init=False)
    """Reports since the last instant about a hand leading each arm, oldest first."""
    poses: Vector = field(init=False)
    """Poses of the objects: position, m, and quaternion, shape (n, 7)."""
    holders: list[int] = field(init=False)
    """Index of the arm holding each object, -1: none."""
    impulse: float = 0.0
    """Impulse of all contacts between instruments since the start, N s."""
    fixture_impulse: float = 0.0
    """Impulse of all contacts between instruments and fixtures since the start, N s."""
    estimate: Vector = field(init=False)
    """A tracker's estimate of a needle's pose: position, m, and quaternion, shape (7,)."""
    reported: bool = False
    """Whether something has been reported as done since the last instant."""
    tips_seen: NDArray[np.bool_] = field(init=False)
    """Whether each tip is in the endoscope's view, shape (m,)."""
    things_seen: NDArray[np.bool_] = field(init=False)
    """Whether each object is in the endoscope's view, shape (n,)."""

    def __post_init__(self) -> None:
        m, n = self.arms, self.things
        self.tips, self.turns, self.velocities = np.zeros((m, 3)), np.zeros((m, 4)), np.zeros((m, 3))
        self.jerks, self.speeds, self.forces = np.zeros((m, 3)), [0.0] * m, [0.0] * m
        self.hands, self.poses, self.holders = [()] * m, np.zeros((n, 7)), [-1] * n
        self.estimate = np.array([*(0.0,) * 6, 1.0])
        self.tips_seen, self.things_seen = np.ones(m, bool), np.ones(n, bool)


class Reader:
    """Reads the inputs of a task."""

    def __init__(self, params: TaskParams, connected: Set[str]) -> None:
        """`connected`: inputs with a source."""
        arms, things = params.psms, tuple(params.objects)
        ecm = params.ecm
        self.watched = Watched(
            arms,
            things,
            forces=tuple(not connected.isdisjoint(_wrenches(arm)) for arm in arms),
            hands=tuple(f"{arm}/following" in connected for arm in arms),
            tools="tools/impulse" in connected,
            fixtures="fixtures/impulse" in connected if params.fixtures else None,
            camera=ecm is not None and f"{ecm}/measured_cp" in connected,
        )
        self._bases = [base_pose(params, arm) for arm in params.psms]
        self._numbers = {int(arm[-1]): i for i, arm in enumerate(arms)}
        self._ecm = ecm if self.watched.camera else None
        if ecm is not None:
            self._view_base, mounted = base_pose(params, ecm), cast("MountedEcm", params.arms[ecm])
            self._optical_in_tip = optical_in_tip(mounted)
            self._frustum = Frustum(params.camera, params.near, params.far)

    def read(self, inputs: Inputs, now: Instant) -> None:
        """Write the inputs into `now`."""
        watched = self.watched
        for i, arm in enumerate(watched.arms):
            pose, base = inputs[f"{arm}/measured_cp"], self._bases[i]
            now.tips[i] = base[:3, :3] @ pose[:3] + base[:3, 3]
            now.turns[i] = pose[3:]
            if watched.forces[i]:
                tip, rigid = _wrenches(arm)
                now.forces[i] = float(np.linalg.norm(inputs[tip][:3] + inputs[rigid][:3]))
            said = cast("tuple[BoolMessage, ...]", inputs.events(f"{arm}/following"))
            now.hands[i] = tuple(message.data for message in said)
        for i, thing in enumerate(watched.things):
            now.poses[i] = inputs[f"{thing}/pose"]
            now.holders[i] = self._numbers.get(round(float(inputs[f"{thing}/held_by"][0])), -1)
        now.impulse = float(inputs["tools/impulse"][0])
        if watched.fixtures:
            now.fixture_impulse = float(inputs["fixtures/impulse"][0])
        if self._ecm is not None:
            self._look(inputs[f"{self._ecm}/measured_cp"], now)

    def _look(self, pose: Vector, now: Instant) -> None:
        optical = self._view_base @ pose_to_matrix(pose) @ self._optical_in_tip
        now.tips_seen = self._frustum.sees(optical, now.tips)
        now.things_seen = self._frustum.sees(optical, now.poses[:, :3])


def _wrenches(arm: str) -> tuple[str, str]:
    return f"{arm}/tip_wrench", f"{arm}/rigid_wrench"


def base_pose(params: TaskParams, arm: CartArm) -> Vector:
    """Return the pose of `<arm>_base` in the world, shape (4, 4)."""
    if params.mounting == "cart":
        positions = params.setup_joints.get(arm, setup_joints.SIMULATED[arm])
        return setup_joints.base_pose(arm, np.array(positions))
    return params.arms[arm].pose
