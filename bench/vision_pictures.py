"""Needles in a gripper that is carried about, drawn by the renderer, and what the tracker makes of them.

Arm and needle are put where they are, without physics: each seed holds the needle at another place of its arc
and rolled about its wire, and swings the joints otherwise. Fingers cover what they cover, and lamps shade the
rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, pi, radians
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from controllers.needle_tracker.controller import NeedleTracker
from controllers.needle_tracker.params import TrackerParams
from controllers.needle_tracker.pose import move_pose, pose_error
from engines.mujoco.model import build, place
from engines.mujoco.pictures.endoscope import Endoscope
from hub.participant import Inputs, Setup
from hub.planning.scenario_file import load
from robots import rotation
from robots.training.needles import NEEDLES
from robots.transform import inverse_transform, matrix_to_pose, pose_to_matrix
from schemas.vectors import Vector

__all__ = ["PICTURED", "track_pictures"]

_THEIRS = {
    "scene.baseline": "1 mm",
    "participants.endoscope.width": 640,
    "participants.endoscope.height": 480,
    "participants.endoscope.field_of_view": "30 deg",
}
_LEFT = {"participants.tracker.eyes": "left"}
PICTURED: dict[str, dict[str, Any]] = {
    "ours, both eyes": {},
    "ours, one eye": _LEFT,
    "authors', both eyes": _THEIRS,
    "authors', one eye": _THEIRS | _LEFT,
}
"""Changes of the scenario `needle-tracking`, by camera."""
_H = 40_000_000
_NEEDLE = NEEDLES["sh-plus"]
_HELD = np.array([0.0, 0.0, 7.7e-3])
"""Of the wire, in the frame of the tip: where the pads are (`robots.dvrk.end_effectors.rolling_jaw`)."""
_FINGER = 0.0459
"""rad: of a finger that holds the wire, as physics leaves it in the scenario."""
_SWING = np.array([0.03, 0.03, 4e-3, 0.15, 0.15, 0.15])
"""Of the joints, rad and m."""
_RATES = np.array([0.5, 0.4, 0.3, 0.35, 0.45, 0.4])
"""Hz."""
_EDGE_ON = cos(radians(75.0))
"""Least cosine between the needle's normal and the line of sight."""
_EYE = tuple(f"{eye}/{what}" for eye in ("left", "right") for what in ("camera_info", "image_raw"))


class _Scene:
    """The arms of the scenario, and a needle that is put anywhere."""

    def __init__(self, params: Any, tracker: TrackerParams) -> None:
        model = build(params)
        data = mujoco.MjData(model)
        place(model, data, params.arms)
        self._chain, self._qpos = tracker.holder.chain, data.qpos.copy()
        self._arm = [model.joint(f"PSM1/{joint.name}").qposadr[0] for joint in self._chain.joints]
        self._needle = int(model.joint("needle").qposadr[0])
        for finger in ("jaw_left", "jaw_right"):
            self._qpos[model.joint(f"PSM1/{finger}").qposadr[0]] = _FINGER
        self._base = pose_to_matrix(np.array([*tracker.holder.position, *tracker.holder.orientation]))

    def qpos(self, q: Vector, held: Vector) -> Vector:
        """Return all joint positions with the arm at `q` and the needle at `held` (4, 4) in the gripper."""
        self._qpos[self._arm] = q
        x, y, z, *turn = matrix_to_pose(self._base @ self._chain.forward(q) @ held).tolist()
        self._qpos[self._needle : self._needle + 7] = x, y, z, turn[3], *turn[:3]
        return self._qpos.copy()


def _turn(*vector: float) -> Vector:
    return rotation.matrix(rotation.exp(np.array(vector)))


def _grasp(rng: np.random.Generator) -> Vector:
    """Return a pose of the needle in the gripper, shape (4, 4): its wire along the hinge."""
    at, roll = rng.uniform(-0.5, 0.3) * _NEEDLE.arc / 2.0, rng.uniform(-pi / 3.0, pi / 3.0)
    ahead = np.array(
        [[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]]
    )  # its arc goes out ahead of the jaw
    pose = np.eye(4)
    pose[:3, :3] = _turn(roll, 0.0, 0.0) @ ahead @ _turn(0.0, 0.0, -at)
    pose[:3, 3] = _HELD - pose[:3, :3] @ _NEEDLE.points(np.array([at]))[0]
    return pose


def track_pictures(changes: Mapping[str, Any], seed: int, pictures: int = 60) -> dict[str, Vector]:
    """Return errors of each picture: position (m), normal and axis (rad), E of the SRC (m), and NEES."""
    given = load("needle-tracking", [f"{name}={value}" for name, value in changes.items()])
    looked_at = given.params["endoscope"].model_copy(update={"skins": {}})
    params, rng = given.params["tracker"], np.random.default_rng(seed)
    scene, deviations = _Scene(looked_at, params), np.repeat([1.5e-3, 0.1], 3)
    start, camera = np.array(params.holder.start), np.array(params.arms.ECM.start)
    held = _visible(params, rng)
    guess = matrix_to_pose(move_pose(held, deviations * rng.normal(size=6))).tolist()
    params = TrackerParams.model_validate(
        params.model_dump() | {"overlay": False, "grasp": {"position": guess[:3], "orientation": guess[3:]}}
    )
    tracker, phase = NeedleTracker("tracker", params), rng.uniform(0.0, 2.0 * pi, 6)
    tracker.configure(Setup(_H, Path()))
    events: dict[str, tuple[Any, ...]] = {}
    rows = list[tuple[float, ...]]()
    with Endoscope("endoscope", looked_at) as endoscope:
        endoscope.configure(Setup(_H, Path()))
        for i in range(pictures + 1):
            q = start + _SWING * np.sin(2.0 * pi * _RATES * i * _H * 1e-9 + phase)
            values = {
                "PSM1/measured_js": np.concatenate([q, np.zeros(12)]),
                "ECM/measured_js": np.concatenate([camera, np.zeros(8)]),
            }
            out = tracker.step(i * _H, _H, Inputs(values, events=events))
            in_base = params.holder.chain.forward(q)
            estimate = inverse_transform(in_base) @ pose_to_matrix(out["kalmanOutput"])
            if i:
                rows.append(_errors(estimate, held, out["covariance"].reshape(6, 6)))
            shown = endoscope.step(i * _H, _H, Inputs({"qpos": scene.qpos(q, held)}))
            events = {name: tuple(shown[name]) for name in _EYE}
    names = ("position", "normal", "axis", "marks", "nees")
    return dict(zip(names, np.array(rows).T, strict=True))


def _visible(params: TrackerParams, rng: np.random.Generator) -> Vector:
    """Return a grasp of which the arc is not seen edge-on when the arms are where they start."""
    while True:
        held = _grasp(rng)
        guess = matrix_to_pose(held).tolist()
        grasp = {"position": guess[:3], "orientation": guess[3:]}
        model = TrackerParams.model_validate(params.model_dump() | {"grasp": grasp})
        at = NeedleTracker("probe", model).configure(Setup(_H, Path()))["Tcn_hat"].reshape(3, 4)
        sight = at[:, 3] / np.linalg.norm(at[:, 3])
        if abs(sight @ at[:, 2]) > _EDGE_ON:
            return held


def _errors(estimate: Vector, held: Vector, covariance: Vector) -> tuple[float, ...]:
    error, between = pose_error(estimate, held), held - estimate
    marks = _NEEDLE.marks @ between[:3, :3].T + between[:3, 3]
    return (
        float(np.linalg.norm(error[:3])),
        float(np.arccos(np.clip(estimate[:3, 2] @ held[:3, 2], -1.0, 1.0))),
        abs(float(error[5])),
        float(np.linalg.norm(marks, axis=1).sum()),
        float(error @ np.linalg.solve(covariance, error)),
    )
