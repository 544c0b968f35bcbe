"""The place of a camera in the room from which a robot hides least of a subject."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from schemas.vectors import Vector

__all__ = ["Sight", "clearest_position"]

_AZIMUTHS, _ELEVATIONS = 24, (0.45, 0.75)
"""Number of directions around the vertical, and their angles above the horizon, rad."""
_USUAL = np.array([0.5, -0.72, 0.48]) / np.linalg.norm([0.5, -0.72, 0.48])
"""Preferred direction of the camera: between the axes and from above, three sides of a box are seen."""
_PREFERENCE = 0.05
"""Share of the subject that may be hidden more from the preferred direction than from the opposite one."""
_GRID = 5
"""Points along each side of the box around the subject, all on the height of its middle."""
_MARGIN = 0.004
"""Distance in front of a point of the subject within which nothing hides the point, m: its own surface."""


_cast_ray: Callable[..., float] = mujoco.mj_ray  # pyright: ignore


class Sight:
    """Lines of sight in a scene at several states."""

    def __init__(self, model: mujoco.MjModel, states: Sequence[Vector]) -> None:
        """`states`: positions of the joints, each of shape (nq,)."""
        self._model, self._states = model, states
        self._data = mujoco.MjData(model)
        self._groups = np.array([1, 1, 1, 0, 0, 0], np.uint8)  # the groups that are drawn

    def hidden(self, positions: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the hidden share of `points`, shape (n, 3), from each of `positions`, shape (m, 3)."""
        counts = np.zeros(len(positions))
        for _ in self._each_state():
            for row, position in enumerate(positions):
                counts[row] += sum(self._is_hidden(position, point) for point in points)
        return counts / (len(points) * max(len(self._states), 1))

    def seen(self, things: Collection[str]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return positions at all states, m in the world: of bodies, and of the tips of instruments.

        The shapes are (n, 3); `things` are names of bodies.
        """
        sites = [self._model.site(i) for i in range(self._model.nsite)]
        tips = [site.id for site in sites if site.name.startswith("PSM") and site.name.endswith("/tip")]
        bodies = [self._model.body(name).id for name in things]
        found = [(self._data.xpos[bodies], self._data.site_xpos[tips]) for _ in self._each_state()]
        return np.concatenate([one for one, _ in found]), np.concatenate([one for _, one in found])

    def _each_state(self) -> Iterator[None]:
        for state in self._states:
            self._data.qpos[:] = state
            mujoco.mj_kinematics(self._model, self._data)
            yield

    def _is_hidden(self, position: NDArray[np.float64], point: NDArray[np.float64]) -> bool:
        ray = point - position
        length = float(np.linalg.norm(ray))
        nearest = _cast_ray(self._model, self._data, position, ray / length, self._groups, True, -1, None)
        return 0.0 <= nearest < length - _MARGIN


def clearest_position(
    sight: Sight, centre: NDArray[np.float64], size: NDArray[np.float64], distance: float
) -> NDArray[np.float64]:
    """Return the position, shape (3,), at a distance from `centre`, from which least is hidden.

    Args:
        sight: lines of sight in the scene.
        centre: point looked at and middle of the subject, shape (3,), m in the world.
        size: extents of the subject, shape (3,), m.
        distance: distance of the camera from `centre`, m.
    """
    turns = np.linspace(0.0, 2.0 * np.pi, _AZIMUTHS, endpoint=False)
    directions = np.array(
        [
            [np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)]
            for rise in _ELEVATIONS
            for turn in turns
        ]
    )
    steps = np.linspace(-0.5, 0.5, _GRID)
    points = np.array([centre + size * [x, y, 0.0] for x in steps for y in steps])
    positions = centre + distance * directions
    cost = sight.hidden(positions, points) - _PREFERENCE * 0.5 * (1.0 + directions @ _USUAL)
    return positions[int(np.argmin(cost))]
