"""Boards, dishes, phantoms and boxes with discs, as fixed bodies of the MuJoCo model.

Every post and dish is a separate body: MuJoCo looks for contacts between bodies with overlapping boxes.
"""

from __future__ import annotations

from math import cos, pi, sin
from typing import Any

import mujoco
import numpy as np

from engines.mujoco.model.objects import LEVEL
from engines.mujoco.model.poses import pose_attributes
from robots.training.dishes import DISH
from robots.training.fixtures import BoardParams, DiscBoxParams, DishParams, FixtureParams, PhantomParams
from robots.training.targets import BOX, DISC_HEIGHT, DISC_RADIUS, DISCS

__all__ = ["add"]

_BOARD, _POST, _WALL = [0.16, 0.19, 0.24, 1.0], [0.82, 0.84, 0.86, 1.0], [0.55, 0.62, 0.68, 0.55]
_DISH, _BOTTOM = [0.75, 0.8, 0.84, 1.0], [0.9, 0.92, 0.94, 1.0]
_BASE = [0.55, 0.5, 0.42, 1.0]
_IN, _OUT = [0.1, 0.2, 0.9, 1.0], [0.85, 0.1, 0.1, 1.0]
"""Insertion blue, extraction red, as in the authors' scene."""
_HOLE = 0.8e-3
"""Radius of the dot on a hole, m."""
_RED, _WHITE = [0.8, 0.05, 0.05, 1.0], [1.0, 1.0, 1.0, 1.0]
_SEEN: dict[str, Any] = {"contype": 0, "conaffinity": 0}
_SEGMENTS = 24
"""Number of boxes in a rim: the inner faces are at most 0.25 mm off the circle."""
_FILM = 1e-4
"""Thickness of the painted floor of a dish, m."""


def add(spec: mujoco.MjSpec, name: str, params: FixtureParams) -> None:
    """Add a fixture to the world, as bodies `name` and `name/...`."""
    match params:
        case BoardParams():
            _add_board(spec, name, params)
        case DishParams():
            _add_dish(spec, name, params)
        case PhantomParams():
            _add_phantom(spec, name, params)
        case DiscBoxParams():
            _add_disc_box(spec, name, params)


def _add_board(spec: mujoco.MjSpec, name: str, params: BoardParams) -> None:
    board, pose = params.measures, params.pose
    slab = _at(spec, name, pose, (0.0, 0.0, -board.size[2] / 2.0))
    half = [extent / 2.0 for extent in board.size]
    slab.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_BOX, size=half, rgba=_BOARD, **LEVEL)
    tip = board.post_height - board.post_radius
    for i, (x, y) in enumerate(board.posts.tolist()):
        _at(spec, f"{name}/post{i}", pose, (x, y, 0.0)).add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=[board.post_radius, 0.0, 0.0],
            fromto=[0.0, 0.0, 0.0, 0.0, 0.0, tip],
            rgba=_POST,
        )
    if (wall := board.wall) is not None:
        half = [extent / 2.0 for extent in wall.size]
        body = _at(spec, f"{name}/wall", pose, (*wall.centre, half[2]))
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=half, rgba=_WALL)


def _add_dish(spec: mujoco.MjSpec, name: str, params: DishParams) -> None:
    body = _at(spec, name, params.pose, (0.0, 0.0, 0.0))
    thickness, half = DISH.outer_radius - DISH.inner_radius, DISH.height / 2.0
    middle = DISH.inner_radius + thickness / 2.0
    for k in range(_SEGMENTS):
        turn = 2.0 * pi * k / _SEGMENTS
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[thickness / 2.0, DISH.outer_radius * pi / _SEGMENTS, half],
            pos=[middle * cos(turn), middle * sin(turn), half],
            quat=[cos(turn / 2.0), 0.0, 0.0, sin(turn / 2.0)],
            rgba=_DISH,
        )
    size = [DISH.inner_radius, _FILM / 2.0, 0.0]
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=size, pos=[0.0, 0.0, _FILM / 2.0], rgba=_BOTTOM, **_SEEN
    )


def _add_phantom(spec: mujoco.MjSpec, name: str, params: PhantomParams) -> None:
    """Add the base under the skin.

    Instruments and needles pass through the skin: another engine simulates the skin.
    """
    x, y, z = params.measures.skin
    half = [x / 2.0, y / 2.0, params.measures.base / 2.0]
    body = _at(spec, name, params.pose, (0.0, 0.0, -z - half[2]))
    body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_BOX, size=half, rgba=_BASE, **LEVEL)
    skin = _at(spec, f"{name}/holes", params.pose, (0.0, 0.0, 0.0))
    for hole, kind in zip(params.measures.holes, params.measures.names, strict=True):
        skin.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[_HOLE, _FILM, 0.0],
            pos=[*hole[:2, 3], 0.0],
            rgba=_IN if kind.startswith("entry") else _OUT,
            **_SEEN,
        )


def _add_disc_box(spec: mujoco.MjSpec, name: str, params: DiscBoxParams) -> None:
    body = _at(spec, name, params.pose, (0.0, 0.0, 0.0))
    half = [extent / 2.0 for extent in BOX]
    middle = [0.0, 0.0, -DISC_HEIGHT - half[2]]
    body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_BOX, size=half, pos=middle, rgba=_RED)
    for x, y in DISCS:
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[DISC_RADIUS, DISC_HEIGHT / 2.0, 0.0],
            pos=[x, y, -DISC_HEIGHT / 2.0],
            rgba=_WHITE,
            **_SEEN,
        )


def _at(
    spec: mujoco.MjSpec, name: str, pose: np.ndarray, offset: tuple[float, float, float]
) -> mujoco.MjsBody:
    """Add a body at `offset` (m) in the frame of the fixture at `pose`, shape (4, 4)."""
    there = pose.copy()
    there[:3, 3] += pose[:3, :3] @ offset
    return spec.worldbody.add_body(name=name, **pose_attributes(there))
