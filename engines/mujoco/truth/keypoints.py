"""Keypoints, pose and shaft edges of instruments, and whether a picture shows them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from engines.mujoco.model.seats import is_engaged, seat_place
from engines.mujoco.params import SceneParams
from engines.mujoco.truth.labels import Body
from engines.mujoco.truth.sight import Sight, Viewpoint
from engines.mujoco.truth.surfaces import body_triangles
from robots.dvrk.instruments import SHAFT_RADIUS
from robots.dvrk.mounted.mounted_psm import MountedPsm
from robots.transform import inverse_transform, rigid_transform
from schemas.vectors import Vector

__all__ = ["Instrument", "InstrumentView", "Keypoint", "instruments"]

_INSIDE_M = 1.3 * SHAFT_RADIUS
"""A keypoint within an instrument is seen if the surface before it is that near, m."""
_END_M = 0.2e-3
"""Points of a finger within this distance of its farthest point are its end, m."""


class Keypoint(NamedTuple):
    """A point of an instrument in a picture."""

    pixel: Vector
    """u right, v down, shape (2,); NaN behind the camera."""
    position: Vector
    """Place in the optical frame, shape (3,), m."""
    visibility: int
    """COCO's number: 0 outside the picture, 1 hidden, 2 seen."""


class InstrumentView(NamedTuple):
    """An instrument in a picture."""

    tool: str
    keypoints: Mapping[str, Keypoint]
    tip_pose: Vector
    """Tip frame in the optical frame, shape (4, 4)."""
    shaft_edges: Sequence[Vector]
    """Outlines of the shaft inside the picture, shape (2, 2) each, px."""


@dataclass(frozen=True)
class Instrument:
    """Points of an instrument, each fixed in a body of the model."""

    arm: str
    tool: str
    """Name of the instrument, `LARGE_NEEDLE_DRIVER_400006`."""
    points: Mapping[str, tuple[int, Vector]]
    """Body, and place in the body's frame, shape (3,), m, by name: `shaft_end`, joints of the wrist, `tip`,
    ends of fingers or blade.
    """
    tip_turn: Vector
    """Turn of the tip frame in its body, shape (3, 3)."""
    seat: int | None
    """Place of the seat in `qpos`; None: an arm without spare instruments."""
    shaft: tuple[int, Vector, Vector]
    """Body, and the ends of the shaft's axis in its frame, the lower one first, shape (3,) each, m."""

    def is_in_arm(self, data: mujoco.MjData) -> bool:
        """Return whether the arm holds this one of its instruments."""
        return is_engaged(data, self.seat)

    def view(self, data: mujoco.MjData, sight: Sight, bodies: tuple[Body, ...]) -> InstrumentView:
        """Return the instrument in what a camera sees; `bodies`: of the scene."""
        return InstrumentView(
            self.tool,
            self.keypoints(data, sight, bodies),
            self.tip_pose(data, sight.view),
            self.shaft_edges(data, sight.view),
        )

    def keypoints(self, data: mujoco.MjData, sight: Sight, bodies: tuple[Body, ...]) -> dict[str, Keypoint]:
        """Return the keypoints in what a camera sees; `bodies`: of the scene."""
        view = sight.view
        local = view.to_camera(np.stack([_place(data, *point) for point in self.points.values()]))
        pixels = np.full((len(local), 2), np.nan)
        ahead = local[:, 2] > 0.0
        pixels[ahead] = view.projection.project(local[ahead])
        own = {body.id for body in bodies if body.name.partition("/")[0] == self.arm}
        return {
            name: Keypoint(pixel, position, _visibility(sight, pixel, float(position[2]), own))
            for name, pixel, position in zip(self.points, pixels, local, strict=True)
        }

    def tip_pose(self, data: mujoco.MjData, view: Viewpoint) -> Vector:
        """Return the pose of the tip frame in the optical frame, shape (4, 4)."""
        body, place = self.points["tip"]
        turn = data.xmat[body].reshape(3, 3) @ self.tip_turn
        return inverse_transform(view.pose) @ rigid_transform(turn, _place(data, body, place))

    def shaft_edges(self, data: mujoco.MjData, view: Viewpoint) -> list[Vector]:
        """Return the two outlines of the shaft inside the picture, each from the lower end, shape (2, 2), px.

        Empty if the shaft is not in the picture. What hides the shaft is not taken into account.
        """
        body, lower, upper = self.shaft
        ends = view.to_camera(np.stack([_place(data, body, lower), _place(data, body, upper)]))
        lines = (_clip_line(view, line) for line in _outlines(ends))
        return [line for line in lines if line is not None]


def instruments(params: SceneParams, model: mujoco.MjModel) -> tuple[Instrument, ...]:
    """Return the instruments of all PSMs of a scene."""
    psms = {name: arm for name, arm in params.arms.items() if isinstance(arm, MountedPsm)}
    return tuple(
        _instrument(name, owner, one, model)
        for name, arm in psms.items()
        for owner, one in arm.by_owner(name).items()
    )


def _instrument(arm: str, owner: str, params: MountedPsm, model: mujoco.MjModel) -> Instrument:
    roll, *wrist = [joint.name for joint in params.tool.joints]
    body = model.body(f"{owner}/{roll}").id
    height = body_triangles(model, body, "shaft").vertices[:, 2]
    last, tip = model.body(f"{owner}/{params.chain.joints[-1].name}").id, params.chain.tip
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    ends = sorted(
        (np.array([0.0, 0.0, z]) for z in (height.min(), height.max())),
        key=lambda end: float(np.linalg.norm(_place(data, body, end) - _place(data, last, tip[:3, 3]))),
    )
    points = {"shaft_end": (body, ends[0])}
    points |= {name: (model.body(f"{owner}/{name}").id, np.zeros(3)) for name in wrist}
    points["tip"] = last, tip[:3, 3]
    parents = {link.parent for link in params.end_effector_links}
    fingers = [link.name for link in params.end_effector_links if link.name not in parents]
    for name in fingers or wrist[-1:]:  # a hook or a blade is fixed to the last link
        finger = model.body(f"{owner}/{name}").id
        points[f"{name}_end"] = finger, _far_end(body_triangles(model, finger).vertices)
    shaft = (body, ends[0], ends[1])
    return Instrument(arm, params.tool.name, points, tip[:3, :3], seat_place(model, owner), shaft)


def _far_end(points: Vector) -> Vector:
    """Return the middle of the points farthest from the origin, shape (3,)."""
    distance = np.linalg.norm(points, axis=1)
    return points[distance > distance.max() - _END_M].mean(axis=0)


def _place(data: mujoco.MjData, body: int, point: Vector) -> Vector:
    """Return a point of a body in the world, shape (3,), m."""
    return data.xpos[body] + data.xmat[body].reshape(3, 3) @ point


def _visibility(sight: Sight, pixel: Vector, depth: float, own: set[int]) -> int:
    width, height = sight.view.size
    if not np.isfinite(pixel).all() or not (
        -0.5 <= pixel[0] < width - 0.5 and -0.5 <= pixel[1] < height - 0.5
    ):
        return 0
    column, row = np.rint(pixel).astype(np.int64)
    margin = _INSIDE_M if int(sight.bodies[row, column]) in own else 0.0
    return 2 if sight.sees(pixel[None], np.array([depth - margin]))[0] else 1


def _outlines(ends: Vector) -> list[Vector]:
    """Return both outlines of a shaft between the `ends` of its axis, shape (2, 3), each of shape (2, 3).

    All in the optical frame, m. An outline is where rays from the camera touch the cylinder. None if the
    camera is inside.
    """
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    away = ends[0] - (ends[0] @ along) * along
    distance = float(np.linalg.norm(away))
    if distance <= SHAFT_RADIUS:
        return []
    towards = away / distance
    share = SHAFT_RADIUS / distance
    near, aside = (
        -share * SHAFT_RADIUS * towards,
        SHAFT_RADIUS * np.sqrt(1.0 - share**2) * np.cross(along, towards),
    )
    return [ends + near + side * aside for side in (-1.0, 1.0)]


def _clip_line(view: Viewpoint, ends: Vector) -> Vector | None:
    """Return the part of a line in the picture, shape (2, 2), px; None if there is none.

    `ends`: in the optical frame, shape (2, 3), m. The sides of what the camera sees are planes through it.
    """
    width, height = view.size
    homogeneous = ends @ view.projection.intrinsics.T  # (2, 3): u z, v z, z
    u, v, z = homogeneous.T
    inside = np.stack([u + 0.5 * z, (width - 0.5) * z - u, v + 0.5 * z, (height - 0.5) * z - v, z - 1e-6])
    first, last = 0.0, 1.0
    for start, end in inside:
        if start < 0.0 and end < 0.0:
            return None
        if start * end < 0.0:
            crossing = start / (start - end)
            first, last = (max(first, crossing), last) if start < 0.0 else (first, min(last, crossing))
    if first >= last:
        return None
    return view.projection.project(ends[0] + np.array([[first], [last]]) * (ends[1] - ends[0]))
