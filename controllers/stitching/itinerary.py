"""The way of a hand through a whole stitch, and whether the joints can follow. SI units, world.

The range of the shaft's roll is more than a turn: the same pose of the tip may be near either end of the
range, by the history of the arm. So a way is examined as a whole, from the arm's present roll.
"""

from __future__ import annotations

from math import ceil

import numpy as np

from controllers.expert.hand import RobotHand
from controllers.stitching.feasibility import best_reach
from controllers.stitching.geometry import approach_pose
from controllers.stitching.rejoin import BACK
from robots import rotation
from robots.transform import inverse_transform, pose_to_matrix
from schemas.vectors import Vector

__all__ = ["Itinerary"]

_SLICE, _TURN = 5.0e-3, 0.2
"""m and rad: at most between two poses of a line looked at."""


class Itinerary:
    """Straight lines of a `RobotHand` from the present pose, and paths of the needle in the jaw."""

    def __init__(self, hand: RobotHand) -> None:
        self.hand = hand
        self._tips = [pose_to_matrix(hand.measured)[None]]
        self._carrying = list[tuple[Vector, Vector]]()

    def copy(self) -> Itinerary:
        """Return an itinerary that can continue differently."""
        other = Itinerary(self.hand)
        other._tips, other._carrying = list(self._tips), list(self._carrying)
        return other

    def go(self, tip: Vector) -> None:
        """Go on a line to a pose, shape (4, 4)."""
        self._tips.append(_line(self._tips[-1][-1], tip))

    def lead(self, needle: Vector, grip: Vector) -> None:
        """Go on a line where the needle, held with `grip`, comes to a pose, shape (4, 4)."""
        self.go(needle @ grip)
        self._carrying.append((self._tips[-1], grip))

    def follow(self, needles: Vector, grip: Vector) -> None:
        """Lead the needle through poses, shape (n, 4, 4), near to each other."""
        self._tips.append(needles @ grip)

    def take_hold(self, needle: Vector, grip: Vector) -> None:
        """Come along the fingers, and take the needle."""
        self.go(_retreat_pose(needle @ grip))
        self.go(needle @ grip)

    def leave(self, rest: Vector | None = None) -> None:
        """Go back along the fingers, and to the resting pose, shape (7,)."""
        self.go(_retreat_pose(self._tips[-1][-1]))
        if rest is not None:
            self.go(pose_to_matrix(rest))

    @property
    def margin(self) -> float:
        """Least share of half a joint's range left; below `feasibility.MARGIN` the way is not feasible."""
        return best_reach(self.hand.chain, self.hand.base, np.concatenate(self._tips), self.hand.roll).margin

    def distance(self, place: Vector) -> float:
        """Return how near tip or needle come to a place, shape (3,), while the needle is carried."""
        ways = [
            way[:, :3, 3] for tips, grip in self._carrying for way in (tips, tips @ inverse_transform(grip))
        ]
        return min((float(np.linalg.norm(way - place, axis=1).min()) for way in ways), default=np.inf)


def _retreat_pose(tip: Vector) -> Vector:
    """Return the pose (4, 4) of a tip on approach to `tip` and on retreat."""
    return pose_to_matrix(approach_pose(tip, BACK))


def _line(a: Vector, b: Vector) -> Vector:
    """Return poses, shape (n, 4, 4), after `a` on the straight line to `b`, with the shortest turn."""
    turn = rotation.log(rotation.from_matrix(b[:3, :3] @ a[:3, :3].T))
    way, angle = b[:3, 3] - a[:3, 3], float(np.sqrt(turn @ turn))
    n = max(1, ceil(float(np.sqrt(way @ way)) / _SLICE), ceil(angle / _TURN))
    shares = np.arange(1, n + 1) / n
    poses = np.tile(b, (n, 1, 1))
    poses[:-1, :3, 3] = a[:3, 3] + shares[:-1, None] * way
    if angle > 0.0:
        x, y, z = turn / angle
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        sine, cosine = np.sin(shares[:-1, None, None] * angle), np.cos(shares[:-1, None, None] * angle)
        poses[:-1, :3, :3] = (np.eye(3) + sine * cross + (1.0 - cosine) * (cross @ cross)) @ a[:3, :3]
    return poses
