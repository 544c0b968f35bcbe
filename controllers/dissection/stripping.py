"""The grasper strips fat off without heat: it pinches a fold, lifts the fold, and lets go. SI units."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import numpy as np

from controllers.cholecystectomy.approach import NEAR, choose_pose, withdraw
from controllers.dissection.clearing import Clearing
from controllers.dissection.step import Step
from robots import rotation
from robots.transform import matrix_to_pose
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["Stripping"]

_OPEN = np.radians(24.0)
"""Angle of the jaw before a fold: 6 mm between its ends, twice the thickness of the fat."""
_BEFORE, _PRESS, _DEEPER = 15.0e-3, 3.0e-3, 1.0e-3
"""Straight way to the fat, depth of the ends in it, and what a second try adds, m."""
_COLUMN, _AROUND = 2.5e-3, 10.0e-3
"""Radius of the fat below a finger, and about a place of the fat that tells its normal, m."""
_HALF, _ASKEW = 3.2e-3, 2.5e-3
"""Half the distance of the ends of the open jaw, and largest difference of the fat below them, m."""
_OFF = 5.5e-3
"""Least distance of a fold from other organs, so that no wall is taken with it, m; assumed."""
_PULLED, _ENOUGH = 13.0e-3, 12
"""Distance from a fold of ties that its lift parts, and number of these beyond which more is no better, m."""
_FEWEST = 2
"""Ties for which a fold is worth a lift."""
_SPARED = 8.0e-3
"""Distance of a fold from organs to be spared, m; assumed."""
_LIFTED, _OVER = 25.0e-3, 18.0e-3
"""Way of a fold along the normal of the fat, and over what is still tied, m. Areolar tissue parts at 8 mm."""
_GENTLE, _SLOW = 0.3, 0.15
"""Shares of the speed before tissue, and of a lift."""
_CLOSING, _OPENING = 0.6, 0.4
"""Times for the jaw, s."""
_MOST = 20
"""Most folds."""
_TILTS = np.radians([-50.0, -25.0, 0.0, 25.0, 50.0])
_ROLLS = np.radians([0.0, 60.0, 120.0])


class Stripping(Clearing):
    """Takes fat off bluntly, by folds that stand off what lies below."""

    def aim_fold(self) -> None:
        """Choose the next fold, and send the grasper there; end where no fold is left to try."""
        state, hand = self.state, self.grasper
        if not hand.has_arrived:
            return
        is_over = self.is_free or state.folds >= _MOST or state.skipped >= self.params.attempts
        folds = islice(self._reachable(), state.skipped, None)
        if is_over or (found := next(folds, None)) is None:
            self._end_stripping()
            return
        state.goal[:], state.place[:], state.normal[:], state.over[:] = found
        state.before = len(self.ties)
        hand.move_jaw(_OPEN)
        hand.go(withdraw(state.goal, _BEFORE))
        self.enter(Step.HOVER_FOLD)

    def _reachable(self) -> Iterator[tuple[Vector, Vector, Vector, Vector]]:
        """Yield pose, place, normal of the fat, and direction over what is tied, the best fold first."""
        for place in self._fold_places():
            around = self.ties[np.linalg.norm(self.ties - place, axis=1) < _PULLED]
            normal, over = self._normal_at(place), around.mean(axis=0) - place
            over -= (over @ normal) * normal
            over /= max(float(np.linalg.norm(over)), 1e-9)
            obstacles = self.seen.obstacles.near(place, NEAR)
            try:
                poses = self._fold_poses(place, normal)
                pose = choose_pose(self.grasper, poses, _BEFORE, _OPEN, obstacles, "the fat")
            except MotionError:
                continue
            yield matrix_to_pose(pose), place, normal, over

    def hover_fold(self) -> None:
        """Wait before the fat, then go ahead."""
        if self.grasper.has_arrived:
            self.grasper.go(self.state.goal, _GENTLE)
            self.enter(Step.REACH_FOLD)

    def reach_fold(self) -> None:
        """Wait for the end of the way, then close."""
        if self.grasper.has_arrived:
            self.grasper.move_jaw(0.0)
            self.enter(Step.PINCH)

    def pinch(self) -> None:
        """Wait for a hold, then lift; without one try another place, deeper."""
        state, hand = self.state, self.grasper
        if state.elapsed < _CLOSING:
            return
        state.folds += 1
        if not self.seen.is_held:
            state.skipped += 1
            self._let_go()
            return
        goal = hand.line()
        goal[:3] += _LIFTED * state.normal + _OVER * state.over
        hand.go(goal, _SLOW)
        self.enter(Step.STRIP)

    def strip(self) -> None:
        """Lift until the way is at its end, or the pull is too large; then let go."""
        state, hand = self.state, self.grasper
        is_large = self.seen.pull > self.params.pull[1]
        if is_large:
            hand.stay()
        if is_large or hand.has_arrived or not self.seen.is_held:
            has_parted = len(self.ties) < state.before
            state.skipped = 0 if has_parted else state.skipped + 1
            self._let_go()

    def release_fold(self) -> None:
        """Wait for the jaw to open, then draw back."""
        if self.state.elapsed > _OPENING:
            self.grasper.go(withdraw(self.grasper.line(), _BEFORE), _GENTLE)
            self.enter(Step.AIM_FOLD)

    def _let_go(self) -> None:
        self.grasper.move_jaw(2.0 * _OPEN)
        self.enter(Step.RELEASE_FOLD)

    def _end_stripping(self) -> None:
        state = self.state
        state.stripped, state.skipped = True, 0
        if self.is_free:
            self.say("the fat is cleared")
            self.end_fat()
        else:
            self.say(f"{len(self.ties)} places of the fat are left for the hook")
        self.enter(Step.AIM_GRASP)

    def _fold_places(self) -> Vector:
        """Return places of the fat that stand off other organs, most ties around first, m, shape (n, 3)."""
        sheet, seen = self.seen.sheet, self.seen
        places = sheet[_apart(sheet, seen.gallbladder) > _OFF]
        places = places[_apart(places, seen.organs) > _OFF]
        places = places[_apart(places, seen.spared) > _SPARED]
        off = np.linalg.norm(places[:, None] - self.ties, axis=2)
        count = (off < _PULLED).sum(axis=1)
        kept = count >= _FEWEST
        near = np.where(off < _PULLED, off, 0.0).sum(axis=1)[kept] / count[kept]
        order = np.lexsort((near, -np.minimum(count[kept], _ENOUGH)))
        found: Vector = places[kept][order]
        return found

    def _normal_at(self, place: Vector) -> Vector:
        """Return the normal of the fat around a place, towards the instruments, shape (3,)."""
        sheet = self.seen.sheet
        return self._towards_port(sheet[np.linalg.norm(sheet - place, axis=1) < _AROUND])

    def _fold_poses(self, place: Vector, normal: Vector) -> Vector:
        """Return poses of a tip with both ends of its open jaw in the fat, shape (n, 4, 4).

        Raises MotionError where fat lies below one end alone.
        """
        length = self.grasper.jaw.length
        across = np.cross(normal, self.state.ahead)
        across /= np.linalg.norm(across)
        poses: list[Vector] = []
        for tilt in _TILTS.tolist():
            for axis in (across, np.cross(normal, across)):
                z = -rotation.matrix(rotation.exp(tilt * axis)) @ normal
                y0 = np.cross(z, across)
                y0 /= np.linalg.norm(y0)
                for roll in _ROLLS.tolist():
                    y = rotation.matrix(rotation.exp(roll * z)) @ y0
                    depths = [self._depth(place + side * _HALF * y, z) for side in (-1.0, 1.0)]
                    if not abs(depths[1] - depths[0]) < _ASKEW:  # NaN: no fat at both
                        continue
                    end = place + (max(depths) + _PRESS + _DEEPER * self.state.skipped) * z
                    for side in (y, -y):
                        pose = np.eye(4)
                        pose[:3, :3] = np.column_stack([np.cross(side, z), side, z])
                        pose[:3, 3] = end - length * z
                        poses.append(pose)
        if not poses:
            raise MotionError("no jaw stands on the fat with both ends")
        return np.array(poses)

    def _depth(self, place: Vector, ahead: Vector) -> float:
        """Return how far ahead of a place the fat lies, m; infinite: nowhere near."""
        off = self.seen.sheet - place
        depths = off @ ahead
        near = np.linalg.norm(off - depths[:, None] * ahead, axis=1) < _COLUMN
        near &= np.abs(depths) < _AROUND
        return float(depths[near].min()) if near.any() else np.inf


def _apart(points: Vector, others: Vector) -> Vector:
    """Return the distance of each point from the nearest of others, m, shape (n,); infinite without any."""
    found: Vector = np.linalg.norm(points[:, None] - others, axis=2).min(axis=1, initial=np.inf)
    return found
