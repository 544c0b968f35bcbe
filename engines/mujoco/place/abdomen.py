"""An abdomen filled with gas, around organs: wall, bed of fat, loops of small bowel.

Sizes: 3 to 5 l of gas lift the wall 60 to 90 mm over the organs; a loop of small bowel is 25 to 30 mm thick.
The dome is larger where the camera would be outside.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from engines.mujoco.place.bowel import bowel_tube
from engines.mujoco.place.part import PlacePart, ripple, sheet
from engines.mujoco.textures.tissues import TISSUES
from schemas.vectors import Vector

__all__ = ["make_abdomen", "make_wall"]

_LEAST_RADIUS, _LEAST_HEIGHT = 0.15, 0.13
"""Least radius and height of the dome, m."""
_CLEARANCE = 1.3
"""The dome is this many times as far away as the camera."""
_BEDDED, _BEDDED_SHARE = 0.003, 0.15
"""Depth by which the lowest point of an organ is in the bed, m, at most this share of the organ's height."""
_HOLLOW = 0.012
"""Free width around organs before the bed rises, m."""
_LOOP_RADIUS, _LOOPS = 0.0125, 3
_NEAREST_LOOP = 0.045
"""Least distance of a loop from the middle of the organs, m: a small organ lies alone on the bed."""
_CLOSE_LOOP, _FAR_LOOP = (24, 150), (14, 90)
"""Cells around and points along the nearest loop, which may be close to the lens, and the others."""
_BEND = 0.065
"""Way along a loop from bend to bend, m: tighter ones would fold it into itself."""
_CLEAR_ANGLE = 1.05
"""Half the angle around the direction of the camera in which no loop lies, rad."""


def make_abdomen(low: Vector, high: Vector, camera: Vector | None, seed: int = 0) -> list[PlacePart]:
    """Return the surroundings of organs in a box from `low` to `high`, m.

    `camera`: a lens inside; `seed`: of all shapes.
    """
    bedded = min(_BEDDED, _BEDDED_SHARE * float(high[2] - low[2]))
    centre = np.array([*(0.5 * (low + high))[:2], low[2] + bedded])
    footprint = 0.5 * float(np.linalg.norm((high - low)[:2])) + _HOLLOW
    away = np.zeros(3) if camera is None else camera - centre
    reach = float(np.linalg.norm(away[:2]))
    radius = max(_LEAST_RADIUS, _CLEARANCE * reach, 1.6 * footprint)
    height = max(_LEAST_HEIGHT, _CLEARANCE * float(away[2]), 1.5 * float(high[2] - low[2]))
    towards = float(np.arctan2(away[1], away[0])) if reach > 0.0 else -0.5 * np.pi
    return [
        _bed(centre, footprint, radius, seed),
        make_wall(centre, radius, height, seed),
        *_loops(centre, footprint, radius, towards, seed),
    ]


def _bed_height(x: Vector, y: Vector, footprint: float, radius: float, seed: int) -> Vector:
    """Return the height of the bed over its middle, m."""
    outside = np.clip((np.hypot(x, y) - footprint) / (radius - footprint), 0.0, 1.0)
    waves = 0.004 * ripple(x, y, 0.045, 1 + seed) + 0.0015 * ripple(x, y, 0.014, 2 + seed)
    return 0.045 * outside**1.5 + waves * np.minimum(0.1 + 4.0 * outside, 1.0) - 0.001


def _bed(centre: Vector, footprint: float, radius: float, seed: int) -> PlacePart:
    side = 2.1 * radius

    def place(u: Vector, v: Vector) -> Vector:
        x, y = (u - 0.5) * side, (v - 0.5) * side
        return centre + np.stack([x, y, _bed_height(x, y, footprint, radius, seed)], axis=1)

    return sheet(place, (side, side), (44, 44), TISSUES["fat"], 0.09)._replace(layer=1)


def make_wall(centre: Vector, radius: float, height: float, seed: int) -> PlacePart:
    """Dome of the abdominal wall, seen from inside."""

    def place(u: Vector, v: Vector) -> Vector:
        turn, rise = 2.0 * np.pi * u, 0.5 * np.pi * v
        folds = 1.0 + 0.01 * ripple(turn * radius * np.cos(rise), rise * height, 0.06, 5 + seed)
        across = radius * np.cos(rise) * folds
        return centre + np.stack(
            [across * np.cos(turn), across * np.sin(turn), height * np.sin(rise) * folds], axis=1
        )

    part = sheet(
        place, (round(2.0 * np.pi * radius / 0.12) * 0.12, 0.24), (32, 12), TISSUES["peritoneum"], 0.12
    )
    return part._replace(faces=part.faces[:, ::-1], layer=2, is_shaded=False)


def _loops(centre: Vector, footprint: float, radius: float, towards: float, seed: int) -> Iterator[PlacePart]:
    """Loops of small bowel beside and behind the organs, as seen from the direction `towards`, rad."""
    # without a seed the phases that were chosen by eye
    turned = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, _LOOPS) if seed else np.zeros(_LOOPS)
    for loop in range(_LOOPS):
        distance = max(footprint, _NEAREST_LOOP) + (1.2 + 1.75 * loop) * _LOOP_RADIUS
        if distance > 0.95 * radius:
            return
        start, end = towards + _CLEAR_ANGLE, towards + 2.0 * np.pi - _CLEAR_ANGLE
        around, pieces = _CLOSE_LOOP if loop == 0 else _FAR_LOOP
        steps = np.linspace(0.0, 1.0, pieces)
        turn = start + (end - start) * steps
        bends = max(3, round(2.0 * np.pi * distance / _BEND))
        across = (
            distance
            + 0.007 * np.sin(bends * turn + 2.0 * loop + turned[loop])
            + 0.003 * np.sin(1.9 * bends * turn)
        )
        x, y = across * np.cos(turn), across * np.sin(turn)
        z = _bed_height(x, y, footprint, radius, seed) + _LOOP_RADIUS * (
            0.55 + 0.5 * np.sin(0.6 * bends * turn + 1.7 * loop + turned[loop])
        )
        z -= 2.5 * _LOOP_RADIUS * np.clip(1.0 - 9.0 * np.minimum(steps, 1.0 - steps), 0.0, 1.0)
        yield bowel_tube(centre + np.stack([x, y, z], axis=1), _LOOP_RADIUS, around, loop)
