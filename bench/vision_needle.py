"""A needle that is carried about, and what two eyes would see of it, by the camera model alone.

The quick source of pictures for the tracker: points of the wire at each pixel of its length with independent
noise along its normal, cut where the jaws cover it, and the tip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controllers.needle_tracker.arc_fit import Arc, Detection
from controllers.needle_tracker.filter import Estimate, NeedleView
from controllers.needle_tracker.pose import move_pose, pose_error
from controllers.needle_tracker.tracking import NeedleBelief, TrackerSettings, follow_needle
from robots import rotation
from robots.dvrk.endoscope import EYES, StereoCamera
from robots.training.needles import NEEDLES
from schemas.vectors import Vector

NEEDLE = NEEDLES["sh-plus"]
ARC = Arc(NEEDLE)
OURS = StereoCamera()
AUTHORS = StereoCamera(640, 480, np.radians(30.0), 1.0e-3)
"""Their left camera twice: they have a right one of half the size."""
PERIOD_S = 0.04
_NORMAL = np.radians(75.0)
"""Largest angle between the line of sight and the needle's normal: beyond it the arc is seen edge-on."""
_PRIOR = np.repeat([1.5e-3, np.radians(6.0)], 3)
"""How well it is known at the start where the needle was grasped: standard deviations, m, rad."""


@dataclass(frozen=True)
class Trouble:
    """What happens: each as the number of the picture with which it begins."""

    slip: int = -1
    """The needle turns by 20 degrees in the jaws, about an axis that is drawn."""
    covered: range = range(0)
    """The tip is not seen."""
    other: bool = False
    """A second green arc is beside it."""
    angle: float = np.radians(20.0)
    aside: tuple[float, float] = (0.0, 0.0)
    """px by which wire and tip are seen aside in all pictures."""


class Carried:
    """A gripper that moves about 90 mm ahead of the eyes, and a needle in it, drawn by a seed."""

    def __init__(self, camera: StereoCamera, eyes: int, rng: np.random.Generator, drift: tuple[float, float]):
        self.camera, self.rng, self.drift = camera, rng, drift
        self.projections = [camera.projection(eye) for eye in EYES[:eyes]]
        self.phase = rng.uniform(0.0, 2.0 * np.pi, 6)
        self.held = rng.uniform(-0.5, 0.3) * NEEDLE.arc / 2.0  # where the jaws hold it
        grasp = NEEDLE.points(np.array([self.held]))[0]
        while True:
            turn = rotation.matrix(rotation.exp(rng.uniform(-np.pi, np.pi, 3)))
            if abs((self.gripper(0)[:3, :3] @ turn)[2, 2]) > np.cos(_NORMAL) + 0.1:
                break
        self.needle = np.eye(4)
        self.needle[:3, :3], self.needle[:3, 3] = turn, -turn @ grasp
        self.grasp = grasp

    def gripper(self, i: int) -> Vector:
        """Return the gripper's pose in the left camera's frame with picture `i`, shape (4, 4)."""
        t = i * PERIOD_S
        swing = np.sin(2.0 * np.pi * np.array([0.5, 0.4, 0.3, 0.35, 0.45, 0.4]) * t + self.phase)
        pose = np.eye(4)
        pose[:3, 3] = [4e-3, 4e-3, 5e-3] * swing[:3] + [0.0, 0.0, 0.09]
        pose[:3, :3] = rotation.matrix(rotation.exp(0.15 * swing[3:]))
        return pose

    def advance(self, slip: float = 0.0) -> None:
        """Let the needle drift for a period, and turn by `slip` (rad) in the jaws."""
        walk = np.repeat(self.drift, 3) * np.sqrt(PERIOD_S) * self.rng.normal(size=6)
        self.needle = move_pose(self.needle, walk)
        if slip:
            axis = self.rng.normal(size=3)
            turn = np.eye(4)
            turn[:3, :3] = rotation.matrix(rotation.exp(slip * axis / np.linalg.norm(axis)))
            turn[:3, 3] = self.grasp - turn[:3, :3] @ self.grasp
            self.needle = self.needle @ turn

    def views(
        self, i: int, noise_px: float, tip_px: float, seen: float, trouble: Trouble
    ) -> list[NeedleView]:
        """Return what the eyes see with picture `i`, of which the share `seen` of the wire is not covered."""
        gripper = self.gripper(i)
        to_gripper = gripper @ self.needle
        found: list[NeedleView] = []
        for projection in self.projections:
            points = self._wire(projection, to_gripper, noise_px, seen)
            if trouble.other:
                aside = to_gripper @ _OTHER
                points = np.vstack([points, self._wire(projection, aside, noise_px, 1.0)])
            tip = _project(projection, to_gripper, NEEDLE.marks[2:])
            tip = tip + tip_px * self.rng.normal(size=2)
            tips = np.zeros((0, 2)) if i in trouble.covered else tip + trouble.aside
            detection = Detection(points + trouble.aside, np.ones(len(points)), tips)
            found.append(NeedleView(projection @ gripper, detection))
        return found

    def _wire(self, projection: Vector, pose: Vector, noise_px: float, seen: float) -> Vector:
        """Return points of the wire, one for each pixel of its length, shape (n, 2)."""
        half = NEEDLE.arc / 2.0
        fine = np.linspace(-half, half, 2000)
        image = _project(projection, pose, NEEDLE.points(fine))
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(image, axis=0).T))])
        at = np.interp(np.arange(0.5, way[-1]), way, np.arange(2000)).astype(int)
        covered = abs(fine[at] - self.held) < (1.0 - seen) * half
        at = at[~covered]
        along = np.gradient(image, axis=0)[at]
        normal = along[:, ::-1] * (-1.0, 1.0) / np.hypot(*along.T)[:, None]
        return image[at] + noise_px * self.rng.normal(size=(len(at), 1)) * normal


_OTHER = np.eye(4)
_OTHER[:3, :3] = rotation.matrix(rotation.exp(np.array([0.3, 0.2, 0.7])))
_OTHER[:3, 3] = [12e-3, 6e-3, 3e-3]
"""Where a second needle is beside the first."""


def _project(projection: Vector, pose: Vector, points: Vector) -> Vector:
    rays = (points @ pose[:3, :3].T + pose[:3, 3]) @ projection[:, :3].T + projection[:, 3]
    return rays[:, :2] / rays[:, 2:]


@dataclass(frozen=True)
class Errors:
    """Of each picture: position (mm), normal and turn about the axis (degree), NEES, whether it is seen."""

    position: Vector
    normal: Vector
    axis: Vector
    nees: Vector
    seen: Vector


_SETTINGS, _NONE = TrackerSettings(), Trouble()


def track(
    camera: StereoCamera,
    eyes: int,
    seed: int,
    *,
    pictures: int = 100,
    noise_px: float = 0.3,
    tip_px: float = 0.5,
    seen: float = 0.75,
    trouble: Trouble = _NONE,
    settings: TrackerSettings = _SETTINGS,
) -> Errors:
    """Follow a needle through so many pictures at 25 Hz."""
    rng = np.random.default_rng(seed)
    carried = Carried(camera, eyes, rng, settings.drift)
    start = move_pose(carried.needle, _PRIOR * rng.normal(size=6))
    belief = NeedleBelief(Estimate(start, np.diag(_PRIOR**2)))
    rows: list[tuple[float, ...]] = []
    for i in range(pictures):
        if i:
            carried.advance(trouble.angle if i == trouble.slip else 0.0)
        views = carried.views(i, noise_px, tip_px, seen, trouble)
        belief = follow_needle(ARC, belief, views, PERIOD_S if i else 0.0, settings)
        error = pose_error(belief.estimate.pose, carried.needle)
        normals = belief.estimate.pose[:3, 2] @ carried.needle[:3, 2]
        rows.append(
            (
                1e3 * float(np.linalg.norm(error[:3])),
                float(np.degrees(np.arccos(np.clip(normals, -1.0, 1.0)))),
                abs(float(np.degrees(error[5]))),
                float(error @ np.linalg.solve(belief.estimate.covariance, error)),
                float(belief.seen),
            )
        )
    return Errors(*np.array(rows).T)
