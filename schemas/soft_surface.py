"""The surface of a soft body as its messages describe it, for whatever draws it."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from schemas.errors import MessageError
from schemas.trocar_msgs import SoftBodyState, SurfaceChange, SurfaceFilm

__all__ = ["FILM_STEP_M", "FaceKind", "SoftSurface", "film_steps"]

FILM_STEP_M = 10e-6
"""Step of the thickness of a film in `SurfaceFilm`, m."""
_GONE = -1


class FaceKind(IntEnum):
    """Kind of tissue of a face of a surface."""

    OUTSIDE = 0
    """Unchanged since the start of the session."""
    CUT = 1
    """Inside of a cut or tear."""
    COAGULATED = 2
    CHARRED = 3


class SoftSurface(NamedTuple):
    """Faces of a soft body."""

    faces: NDArray[np.int32]
    """Node indices, shape (f, 3), counter-clockwise from outside; -1: an empty slot."""
    kinds: NDArray[np.uint8]
    """`FaceKind` of each face, shape (f,)."""
    origins: NDArray[np.int64]
    """Node of the first state at the resting place of each node, shape (n,)."""

    @classmethod
    def of_first(cls, state: SoftBodyState) -> SoftSurface:
        """Return the surface of a first state. Raises MessageError if it has none, or an invalid one."""
        if state.nodes_m.size % 3 or not state.triangles.size or state.triangles.size % 3:
            raise MessageError(
                f"soft body '{state.body:.40}': {state.triangles.size} numbers of triangles,"
                f" {state.nodes_m.size} of nodes, expected three for each"
            )
        return cls.of_triangles(state.triangles.reshape(-1, 3), state.nodes_m.size // 3)

    @classmethod
    def of_triangles(cls, triangles: NDArray[np.uint32], nodes: int) -> SoftSurface:
        """Return the surface of `triangles`, shape (f, 3). Raises MessageError for nodes beyond `nodes`."""
        if triangles.max(initial=0) >= max(nodes, 1):
            raise MessageError(f"the triangles are not three node indices each, below {nodes}")
        return cls(triangles.astype(np.int32), np.zeros(len(triangles), np.uint8), np.arange(nodes))

    def of_kind(self, kind: FaceKind) -> NDArray[np.int32]:
        """Return the faces of a kind of tissue, without empty slots, shape (k, 3)."""
        return self.faces[(self.kinds == kind) & (self.faces[:, 0] != _GONE)]

    def changed(self, change: SurfaceChange) -> SoftSurface:
        """Return the surface with a change. `self`: the surface of the first state.

        Raises MessageError for a change that does not fit it.
        """
        self._check(change)
        slots, faces = change.slots, change.faces.reshape(-1, 3)
        appended = int((slots >= len(self.faces)).sum())
        changed = np.concatenate([self.faces, np.full((appended, 3), _GONE, np.int32)])
        kinds = np.concatenate([self.kinds, np.zeros(appended, np.uint8)])
        changed[slots], kinds[slots] = faces, change.kinds
        return SoftSurface(changed, kinds, np.concatenate([self.origins, change.origins.astype(np.int64)]))

    def _check(self, change: SurfaceChange) -> None:
        """Raise MessageError if a change does not fit this surface of the first state."""
        slots, kinds, first = change.slots, change.kinds, len(self.faces)
        if not 3 * slots.size == 3 * kinds.size == change.faces.size:
            raise _misfit(change, f"{slots.size} slots, {kinds.size} kinds, {change.faces.size} face nodes")
        if (slots[1:] <= slots[:-1]).any():
            raise _misfit(change, "slots that do not ascend")
        appended = slots[slots >= first]
        if appended.size and int(appended[-1]) != first + appended.size - 1:
            raise _misfit(change, f"{appended.size} appended faces up to slot {appended[-1]} after {first}")
        if kinds.size and kinds.max() > max(FaceKind):
            raise _misfit(change, f"kind {kinds.max()}, allowed are 0 to {max(FaceKind):d}")
        nodes, faces = len(self.origins), change.faces.reshape(-1, 3)
        count = nodes + change.origins.size
        gone = (faces == _GONE).all(axis=1)
        if ((faces < 0).any(axis=1) & ~gone).any() or faces.max(initial=_GONE) >= count:
            raise _misfit(change, f"a face with a node outside 0 to {count - 1}")
        if change.origins.size and change.origins.max() >= nodes:
            raise _misfit(change, f"a copy of node {change.origins.max()}, allowed are 0 to {nodes - 1}")


def film_steps(film: SurfaceFilm, nodes: int) -> NDArray[np.uint8]:
    """Return the thickness of a film at each of `nodes` nodes, in steps of `FILM_STEP_M`, shape (n,).

    Raises MessageError for a film that does not fit.
    """
    if film.nodes.size != film.thickness.size or (film.nodes[1:] <= film.nodes[:-1]).any():
        raise MessageError(
            f"film on '{film.body:.40}': {film.nodes.size} nodes and {film.thickness.size} thicknesses;"
            " expected as many, and ascending nodes"
        )
    if film.nodes.size and film.nodes[-1] >= nodes:
        raise MessageError(f"film on '{film.body:.40}': node {film.nodes[-1]}, allowed are 0 to {nodes - 1}")
    steps = np.zeros(nodes, np.uint8)
    steps[film.nodes] = film.thickness
    return steps


def _misfit(change: SurfaceChange, problem: str) -> MessageError:
    return MessageError(f"changed surface of '{change.body:.40}', version {change.version}: {problem}")
