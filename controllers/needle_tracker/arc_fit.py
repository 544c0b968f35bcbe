"""Residuals of a needle's arc and tip: distances of the seen wire from the image of a pose.

The wire's centre line is projected at many angles. A seen point belongs to the nearest angle, and counts by
its distance along the normal of the projected line: along the line an arc says nothing. The distances of a
piece of the line are averaged, so that pixels across the wire count once. The tip counts in both
directions; the tip alone fixes the rotation about the arc's axis.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from controllers.needle_tracker.noise import PIECES, Noise
from robots.training.needles import NeedleShape
from schemas.vectors import Vector

__all__ = ["Arc", "ArcFit", "Detection", "fit_arc"]

_PIECE = 4
"""Samples of the centre line in a piece; the distances of a piece are averaged."""
_LEAST_COVER = 0.5
"""Least seen share of a piece: the middle of a wire covered in part is elsewhere."""
_MOST_COVER = 1.5
"""Largest seen share of a piece; a piece with more has further wire in its place and is left out."""
_BEYOND = 1.5
"""Samples beyond an end of the line; a point seen up to there belongs to the end."""


@dataclass(frozen=True)
class Detection:
    """The needle's colours as seen by an eye, px."""

    points: Vector
    """On the wire, shape (n, 2)."""
    lengths: Vector
    """Length of wire that each point stands for, px, shape (n,)."""
    tips: Vector
    """Candidates for the tip, shape (k, 2)."""


class Arc:
    """The centre line of a needle, at angles from base to tip, and the place of the seen tip."""

    def __init__(self, needle: NeedleShape, tip_ahead: float = 0.0) -> None:
        """Sample the needle; `tip_ahead`: how far beyond its end the middle of the tip's mark is seen, m."""
        self.needle = needle
        half = needle.arc / 2.0
        angles = np.linspace(-half, half, _PIECE * PIECES + 1)
        angles[-1] += tip_ahead / needle.radius
        self.points = needle.points(angles)  # (m, 3)
        """m, in the needle's frame; the last one is the tip."""
        m = len(self.points)
        self._errors = np.zeros((m, 3, 6))
        self._errors[:, :, :3] = np.eye(3)
        x, y, z = self.points.T
        self._errors[:, 0, 4], self._errors[:, 0, 5] = z, -y
        self._errors[:, 1, 3], self._errors[:, 1, 5] = -z, x
        self._errors[:, 2, 3], self._errors[:, 2, 4] = y, -x

    def width(self, projection: Vector, depth: float) -> float:
        """Return how wide the wire is seen at a depth (m) along the axis, px."""
        # the rows of a projection are the focal length times unit vectors, and the principal point times z
        focal = float(np.linalg.norm(np.cross(projection[0, :3], projection[2, :3])))
        return 2.0 * focal * self.needle.wire_radius / depth

    def project_line(self, projection: Vector, pose: Vector) -> tuple[Vector, Vector, float]:
        """Return the line's image (m, 2), its derivative by an error of `pose` (m, 2, 6), and its mean depth.

        `projection`, shape (3, 4), is from the frame in which the needle has `pose`, shape (4, 4), to pixels.
        """
        turn = pose[:3, :3]
        points = self.points @ turn.T + pose[:3, 3]
        rays = points @ projection[:, :3].T + projection[:, 3]  # (m, 3)
        depth = np.maximum(rays[:, 2:], 1e-3)
        image = rays[:, :2] / depth
        by_point = (projection[None, :2, :3] - image[:, :, None] * projection[None, 2:, :3]) / depth[
            :, :, None
        ]
        return image, (by_point @ turn) @ self._errors, float(depth.mean())


@dataclass(frozen=True)
class ArcFit:
    """Residuals (n,), what they change by with an error (n, 6), and their variances (n,): px, px^2."""

    residuals: Vector
    slopes: Vector
    variances: Vector
    common: Vector
    """What they change by with what lasts, whose parts are independent and of variance 1, (n, k): px."""
    explained: float
    """Length of the seen wire that belongs to the needle, px."""
    unexplained: float
    """Length of what has the wire's colour and does not belong to it, px."""
    expected: float
    """Length of the whole wire in this picture, px."""
    tip: bool
    """Whether the tip is among the residuals."""
    tip_refused: bool
    """Whether something of the tip's colour is seen, but too far away."""

    @property
    def tip_only(self) -> ArcFit:
        """The same without the arc."""
        rows = slice(len(self.residuals) - 2 * self.tip, None)
        return replace(
            self,
            residuals=self.residuals[rows],
            slopes=self.slopes[rows],
            variances=self.variances[rows],
            common=self.common[rows],
        )


def fit_arc(
    arc: Arc, projection: Vector, pose: Vector, seen: Detection, noise: Noise, covariance: Vector, gate: float
) -> ArcFit:
    """Return how far `seen` is from the needle at `pose`, shape (4, 4), through `projection`, shape (3, 4).

    Args:
        arc: the needle.
        projection: from the frame of the pose to pixels.
        pose: of the needle.
        seen: by this eye.
        noise: of what is seen.
        covariance: of the pose's error, shape (6, 6).
        gate: standard deviations up to which something seen is taken for the needle.
    """
    image, slopes, depth = arc.project_line(projection, pose)
    width = arc.width(projection, depth)
    lasts = noise.lasting_noise(width)
    along = cast("Vector", np.gradient(image, axis=0))
    spacing = np.hypot(along[:, 0], along[:, 1])  # (m,)
    tangents = along / np.maximum(spacing, 1e-9)[:, None]
    normals = tangents[:, ::-1] * (-1.0, 1.0)
    rows = np.einsum("mi,mij->mj", normals, slopes)  # (m, 6)
    reach = gate * np.sqrt(np.einsum("mi,ij,mj->m", rows, covariance, rows) + noise.arc**2 + lasts.wire**2)
    reach += 1.0 + 0.5 * width
    residuals, lengths = _by_piece(image, tangents, normals, spacing, reach, seen)
    expected = spacing[:-1].reshape(PIECES, _PIECE).sum(axis=1)
    used = (lengths > _LEAST_COVER * expected) & (lengths < _MOST_COVER * expected)
    tip, refused = _tip(image[-1], slopes[-1], seen.tips, noise.tip**2 + lasts.tip**2, covariance, gate)
    # each piece has the slope of its middle sample
    found = ArcFit(
        residuals[used],
        rows[_PIECE // 2 :: _PIECE][used],
        noise.of_pieces(lengths[used], expected[used], width),
        lasts.of_wire(normals[_PIECE // 2 :: _PIECE])[used],
        float(lengths[used].sum()),
        float(seen.lengths.sum() - lengths.sum()),
        float(expected.sum()),
        tip is not None,
        refused,
    )
    if tip is None:
        return found
    return replace(
        found,
        residuals=np.concatenate([found.residuals, tip]),
        slopes=np.vstack([found.slopes, slopes[-1]]),
        variances=np.concatenate([found.variances, np.full(2, noise.tip**2)]),
        common=np.vstack([found.common, lasts.of_tip()]),
    )


def _by_piece(
    image: Vector, tangents: Vector, normals: Vector, spacing: Vector, reach: Vector, seen: Detection
) -> tuple[Vector, Vector]:
    """Return the mean distance of each piece of the line from what is seen, and its seen length, px."""
    if not len(seen.points):
        return np.zeros(PIECES), np.zeros(PIECES)
    # |a - b|^2 less |a|^2, which does not matter for what is nearest
    far = (image**2).sum(axis=1) - 2.0 * (seen.points @ image.T)  # (n, m)
    nearest = far.argmin(axis=1)
    off = seen.points - image[nearest]
    across = (off * normals[nearest]).sum(axis=1)
    along = (off * tangents[nearest]).sum(axis=1)
    belongs = (abs(across) <= reach[nearest]) & (abs(along) <= _BEYOND * spacing[nearest] + 1.0)
    piece = np.minimum(nearest[belongs] // _PIECE, PIECES - 1)
    weights = seen.lengths[belongs]
    lengths = np.bincount(piece, weights, PIECES).astype(np.float64)
    sums = np.bincount(piece, weights * across[belongs], PIECES)
    return sums / np.maximum(lengths, 1e-9), lengths


def _tip(
    image: Vector, slopes: Vector, tips: Vector, variance: float, covariance: Vector, gate: float
) -> tuple[Vector | None, bool]:
    """Return the distance (2,) of the likeliest of `tips` from the image of the tip, if it is near enough."""
    if not len(tips):
        return None, False
    spread = slopes @ covariance @ slopes.T + variance * np.eye(2)
    off = tips - image  # (k, 2)
    squares = np.einsum("ki,ij,kj->k", off, np.linalg.inv(spread), off)
    best = int(squares.argmin())
    return (off[best], False) if squares[best] <= gate**2 else (None, True)
