"""What is dissected next: fat over the triangle, then the plate. SI units, in the world."""

from __future__ import annotations

import numpy as np

from controllers.cholecystectomy.obstacles import Obstacles
from controllers.dissection.lifting import Lifting
from schemas.vectors import Vector

__all__ = ["Clearing"]

_LEFT = 0.08
"""Share of the fat's area that may stay tied: the critical view of safety asks for a tenth at most."""
_SPARED = 6.0e-3
"""Distance of organs to be spared within which there is no power, m; assumed."""
_BACK, _UNDER, _OVER = 3.0e-3, 2.0e-3, 3.0e-3
"""Distance of the hook before a tied place, depth below the fat, and width of fat that tells it, m."""
_HANGS = 6.0e-3
"""Height off a place beyond which fat hangs loose, and is not what is lifted, m."""
_GROUP = 6.0e-3
"""Distance of tied places from the hook that are burnt together with the first, m."""
_AROUND = 8.0e-3
"""Distance of fat from a place that tells its normal there, m."""
_FAR, _WIDE = 12.0e-3, 4.0e-3
"""Distance from what is spared at which fat is begun, and half the width of fat before a place, m."""
_MARGIN = 7.0e-3
"""Length of free fat before a place that a hook lifts well, m: hook and foot go under it."""
_EDGE, _BESIDE = 7.0e-3, 2.0e-3
"""Depth along the work of the edge of what is tied, and width of fat before a place there, m."""


class Clearing(Lifting):
    """Tells fat from plate, and finds the way of the work."""

    @property
    def ties(self) -> Vector:
        """Places of the present work that hang together, m, shape (n, 3)."""
        return self.seen.fat if self.state.clears else self.seen.plate

    @property
    def is_free(self) -> bool:
        """Whether the present work is done."""
        if self.state.clears:
            return self.seen.fat_area <= _LEFT * self.state.whole
        return self.seen.is_free

    @property
    def may_burn(self) -> bool:
        """Whether the bare end is far enough from organs to be spared."""
        spared = self.seen.spared
        if self.state.clears:
            spared = np.concatenate([spared, self.seen.organs])
        return not len(spared) or bool(np.linalg.norm(spared - self.hook.bare_end, axis=1).min() > _SPARED)

    @property
    def is_beside_fat(self) -> bool:
        """Whether more of the fat is tied beside the hook."""
        apart = np.linalg.norm(self.ties - self.hook.bare_end, axis=1)
        return self.state.clears and bool(apart.min(initial=np.inf) < _GROUP)

    @property
    def fat_body(self) -> Obstacles:
        """The fat, below which the hook goes."""
        sheet = self.seen.sheet if self.state.clears else np.zeros((0, 3))
        return Obstacles.points(sheet, np.zeros(len(sheet)))

    def find_work(self) -> None:
        """Take the directions of plate and fat before anything is touched."""
        state, seen = self.state, self.seen
        self._find_bed()
        state.bed[:] = state.ahead
        state.whole = seen.fat_area
        state.clears = len(seen.fat) > 0
        if state.clears:
            self._find_sheet()

    def edge_places(self, *, is_inside: bool) -> Vector:
        """Return tied places at the edge, the preferred ones first, m, shape (n, 3).

        `is_inside`: the hook is in the tissue: the nearest first. Else fat is begun away from what is spared,
        where enough of it hangs free before a place, and not too much.
        """
        state, ties, spared = self.state, self.ties, self.seen.spared
        along = ties @ state.ahead
        edge = self._fat_edge() if state.clears else ties[along < along.min() + _EDGE]
        far = np.linalg.norm(edge - self.hook.bare_end, axis=1)
        if state.clears and not is_inside:
            far = np.abs(self._margins(edge) - _MARGIN)
            if len(spared):
                far += np.linalg.norm(edge[:, None] - spared, axis=2).min(axis=1) < _FAR
        found: Vector = edge[far.argsort(kind="stable")]
        return found

    def _margins(self, places: Vector) -> Vector:
        """Return the length of free fat before each place, m, shape (n,)."""
        off = self.seen.sheet[None] - places[:, None]
        before = -off @ self.state.ahead
        beside = np.linalg.norm(off + before[..., None] * self.state.ahead, axis=2)
        found: Vector = np.where(beside < _WIDE, before, 0.0).max(axis=1)
        return found

    def _fat_edge(self) -> Vector:
        """Return the places before which the fat is free, m, shape (n, 3)."""
        ties, ahead = self.ties, self.state.ahead
        off = ties[None] - ties[:, None]
        before = -off @ ahead
        beside = np.linalg.norm(off + before[..., None] * ahead, axis=2)
        hidden = ((before > _BESIDE) & (before < _EDGE) & (beside < _BESIDE)).any(axis=1)
        found: Vector = ties[~hidden]
        return found

    def under_fat(self, place: Vector) -> Vector:
        """Take the normal of the fat at a tied place; return where the hook goes under it, m, shape (3,)."""
        state, sheet = self.state, self.seen.sheet
        near = sheet[np.linalg.norm(sheet - place, axis=1) < _AROUND]
        normal = self._towards_port(near)
        normal -= (normal @ state.ahead) * state.ahead
        state.normal[:] = normal / max(float(np.linalg.norm(normal)), 1e-9)
        before = place - _BACK * state.ahead
        off = sheet - before
        heights = off @ state.normal
        over = np.linalg.norm(off - heights[:, None] * state.normal, axis=1) < _OVER
        over &= np.abs(heights) < _HANGS
        lowest = float(heights[over].min()) if over.any() else 0.0
        found: Vector = before + (lowest - _UNDER) * state.normal
        return found

    def end_fat(self) -> None:
        """Go over from the fat to the plate."""
        self.state.clears, self.state.skipped = False, 0
        self._find_bed()
        self.state.bed[:] = self.state.ahead

    def _find_bed(self) -> None:
        """Take direction and normal of the bed from what is tied, from the free end on."""
        state, ties, nodes = self.state, self.seen.plate, self.seen.gallbladder
        middle, body = ties.mean(axis=0), nodes.mean(axis=0)
        _, _, axes = np.linalg.svd(ties - middle)
        tied, all_along = ties @ axes[0], nodes @ axes[0]
        below, above = tied.min() - all_along.min(), all_along.max() - tied.max()
        state.ahead[:] = axes[0] * np.sign(below - above)  # more of the gallbladder is free at its neck
        state.normal[:] = axes[2] * np.sign(axes[2] @ (body - middle))

    def _find_sheet(self) -> None:
        """Take the normal of the fat from where it is tied, and the way into it along the gallbladder."""
        state = self.state
        state.normal[:] = self._towards_port(self.seen.fat)
        way = state.bed - (state.bed @ state.normal) * state.normal
        state.ahead[:] = way / max(float(np.linalg.norm(way)), 1e-9)

    def _towards_port(self, points: Vector) -> Vector:
        """Return the normal of a layer of points (m, shape (n, 3)) on the side of the hook's port."""
        middle = points.mean(axis=0)
        normal: Vector = np.linalg.svd(points - middle)[2][2]
        return normal * np.sign(normal @ (self.hook.base[:3, 3] - middle))
