"""Random goals of visual servoing, and the law on them with an ideal camera at 25 Hz."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from controllers.visual_servoing.camera import kept_view, project_points, seen_points
from controllers.visual_servoing.law import Law, MotionLimits, joint_velocities
from robots import rotation
from robots.dvrk.endoscope import BASELINE, StereoCamera, left_camera
from robots.training.targets import DISC_RADIUS, DISCS
from schemas.vectors import Vector

CAMERA = StereoCamera(360, 288, np.pi / 3.0)
"""Of the authors' scene."""
CHAIN = left_camera("straight", BASELINE)
POINTS = np.column_stack([DISCS, np.zeros(4)])
STEP_S = 0.04
_MARGIN_PX = 8.0
_LENS = np.array([*[CAMERA.focal_length] * 2, *CAMERA.intrinsics()[:2, 2], CAMERA.width, CAMERA.height])
_OFF = np.array([0.25, 0.25, 0.06, 0.5])
"""How far from the goal it starts, at most: rad, m."""


class Servoed(NamedTuple):
    """How one goal was reached."""

    time: float
    """From when on no point is 1 px or more from its place, s; inf: never."""
    rest: float
    """Distance of all features from the goal at the end, normalised."""
    outside: float
    """px by which a point was out of the view that is kept, at most; negative: inside."""


def features(camera: Vector, target: Vector) -> Vector:
    """Return the points as `camera` sees them, normalised, shape (4, 2); both poses in one frame, (4, 4)."""
    return project_points(seen_points(camera, target, POINTS))


def depths(camera: Vector, target: Vector) -> Vector:
    """Return their depths, m, shape (4,)."""
    return seen_points(camera, target, POINTS)[:, 2]


def limits(depths: Vector) -> MotionLimits:
    """Return the limits where the points have these depths, m, shape (4,)."""
    view = kept_view(_LENS, DISC_RADIUS / float(depths.min()), _MARGIN_PX)
    return MotionLimits(CHAIN.lower, CHAIN.upper, CHAIN.velocity, view, 3.0)


def random_goal(rng: np.random.Generator) -> tuple[Vector, Vector, Vector]:
    """Return joint positions of goal and start, shape (4,), and the target's pose in `ECM_base`, (4, 4).

    The target is in view from both, 12 to 20 cm ahead of the goal and tilted by up to 20 degrees and more.
    """
    while True:
        goal = rng.uniform(0.8 * CHAIN.lower, 0.8 * CHAIN.upper)
        goal[2] = rng.uniform(0.03, 0.2)
        ahead = np.eye(4)
        ahead[:3, :3] = rotation.matrix(rotation.exp(rng.uniform(-0.35, 0.35, 3)))
        ahead[:3, 3] = rng.uniform([-0.02, -0.015, 0.12], [0.02, 0.015, 0.20])
        target = CHAIN.forward(goal) @ ahead
        start = goal + rng.uniform(-_OFF, _OFF)
        if CHAIN.contains(start) and all(_in_view(CHAIN.forward(q), target) for q in (goal, start)):
            return goal, start, target


def _in_view(camera: Vector, target: Vector) -> bool:
    away = depths(camera, target)
    return bool((away > 0.05).all()) and _outside(features(camera, target), away) <= 0.0


def _outside(seen: Vector, away: Vector) -> float:
    """Return by how many pixels one of the points is out of the view that is kept."""
    low, high = limits(away).view
    return float(np.maximum(seen - high, low - seen).max()) * CAMERA.focal_length


def servo(
    law: Law,
    gain: float,
    reached: Vector,
    start: Vector,
    target: Vector,
    *,
    goal: Vector | None = None,
    seconds: float = 6.0,
    noise_px: float = 0.0,
    rng: np.random.Generator | None = None,
) -> Servoed:
    """Servo to the features seen at `reached`, or to `goal`, and return how it went."""
    wanted = features(CHAIN.forward(reached), target) if goal is None else goal
    q, errors, outside, seen = start, list[float](), -np.inf, wanted
    for _ in range(round(seconds / STEP_S)):
        frames = CHAIN.frames(q)
        seen, away = features(frames[-1], target), depths(frames[-1], target)
        errors.append(float(np.hypot(*(seen - wanted).T).max()) * CAMERA.focal_length)
        outside = max(outside, _outside(seen, away))
        measured = (
            seen if rng is None else seen + rng.normal(size=seen.shape) * noise_px / CAMERA.focal_length
        )
        jacobian = CHAIN.jacobian(frames, frame="tip")
        velocities = joint_velocities(law, q, jacobian, measured, wanted, away, gain, limits(away))
        q = q + STEP_S * velocities
        if (q < CHAIN.lower - 1e-9).any() or (q > CHAIN.upper + 1e-9).any():
            raise AssertionError(f"out of range: {q}")
    above = np.flatnonzero(np.array(errors) >= 1.0)
    last = -1 if not above.size else int(above[-1])
    time = np.inf if last == len(errors) - 1 else (last + 1) * STEP_S
    return Servoed(time, float(np.linalg.norm(seen - wanted)), outside)
