"""Steps at a tube: clips, and the cut between the second and the third."""

from __future__ import annotations

from functools import partial
from math import radians

import numpy as np

from controllers.cholecystectomy.approach import choose_pose, hurts, jaw_poses, skewed, withdraw
from controllers.cholecystectomy.places import choose_places
from controllers.cholecystectomy.procedure import Procedure, opening
from controllers.cholecystectomy.sub_task import CUT, Failure, Step
from robots import rotation
from robots.transform import matrix_to_pose, pose_to_matrix
from schemas.errors import MotionError

__all__ = ["Dividing"]

BEFORE_TUBE = 22.0e-3
"""Length of the straight way to a tube, m."""
_BITES = {False: (11.0e-3, 9.0e-3, 12.0e-3, 8.0e-3), True: (8.0e-3, 7.0e-3, 9.0e-3, 6.5e-3)}
"""Distance of the tube from the hinge between the jaws of the applier and of the scissors, by attempt, m.

The ends of the jaws pass the tube, and what lies close behind stays outside. Closing blades push a slack tube
some 6 mm towards their ends.
"""
_BESIDE = 1.0e-3
"""Way of further attempts beside the place of the first, m."""
_SQUEEZED, _SNIPPED = radians(12.0), radians(-10.0)
"""Angle of the jaw on a tube before the clip is closed, and of closed scissors."""
_FREE = 2.5e-3
"""Distance of the gallbladder from the wall of a tube where the third clip goes, if there is room, m."""
_CLOSING = 0.5
"""Time for a jaw to close, s."""
_ANSWER = {False: 0.3, True: 0.6}
"""Time for an event after a clip, and for a tube to part after the cut, s."""
_SHIFTED, _TURNED = 1.0e-3, 0.12
"""Movement of the tube (m, rad) after which the hand aims anew."""
_MOST_AIMS = 3


class Dividing(Procedure):
    """Clips and cut."""

    @property
    def cuts(self) -> bool:
        """Whether the present job is a cut."""
        return self.state.job == CUT

    def aim_at_tube(self) -> None:
        """Choose the pose for the present job by the tube's present line, and send the hand there."""
        state, hand = self.state, self.hand
        try:
            state.along = self._place()
        except MotionError as error:
            self.fail(Failure.TOO_SHORT, str(error))
            return
        state.aims = 0
        state.succeeded = state.slipped = False
        self._choose()
        hand.move_jaw(opening(hand))
        hand.go(withdraw(state.goal, BEFORE_TUBE))
        self.enter(Step.HOVER)

    def aim_again(self) -> bool:
        """Choose the pose anew before the last way; return whether the hand may go on there."""
        state, before = self.state, self.state.goal.copy()
        self._choose()
        shift = float(np.linalg.norm(state.goal[:3] - before[:3]))
        turn = float(
            np.linalg.norm(rotation.log(rotation.product(state.goal[3:], rotation.conjugate(before[3:]))))
        )
        if (shift < _SHIFTED and turn < _TURNED) or state.aims >= _MOST_AIMS:
            return True
        state.aims += 1
        self.hand.go(withdraw(state.goal, BEFORE_TUBE))
        return False

    def close_on_tube(self) -> None:
        """Close the jaw, and then the clip."""
        state, hand = self.state, self.hand
        if state.elapsed == 0.0 and self.cuts and self._would_hurt():
            self.retry(Failure.BLOCKED, "an organ to be spared lies between the blades")
            return
        if state.elapsed == 0.0:
            hand.move_jaw(max(hand.jaw.lower, _SNIPPED) if self.cuts else _SQUEEZED)
        if state.elapsed >= _CLOSING:
            self.fires = not self.cuts
            self.enter(Step.CHECK)

    def _would_hurt(self) -> bool:
        """Whether the blades would close on an organ to be spared."""
        pose = pose_to_matrix(self.hand.measured)
        return hurts(self.hand, pose, self.seen.spared.near(pose[:3, 3]))

    def check_tube(self) -> None:
        """Wait for the sign of success."""
        state = self.state
        if self.cuts and state.parted[state.tube]:
            state.succeeded = True
        if state.succeeded:
            self.open_jaw()
        elif state.slipped:
            self.retry(Failure.CLIP_SLIPPED, "the clip does not hold")
        elif state.elapsed > _ANSWER[self.cuts]:
            if self.cuts:
                self.retry(Failure.NOT_PARTED, "the tube still hangs together")
            else:
                self.retry(Failure.CLIP_SLIPPED, "no clip is closed")

    def _place(self) -> float:
        """Return the place of the present job; further attempts go away from the cut."""
        state = self.state
        tube = self.seen.tube(state.tube)
        if (state.clip_places[state.tube] < 0.0).all():
            eye = self.hands.applier.base[:3, 3]
            state.begins[state.tube] = tube.first_place(self.seen.gallbladder, _FREE, eye)
        places = choose_places(tube.length, float(state.begins[state.tube]))
        if self.cuts:
            return places.cut
        outwards = 1.0 if state.job < CUT - 1 else -1.0
        beside = _BESIDE if state.attempts and places.is_roomy else 0.0
        return float(places.clips[state.job] + outwards * beside)

    def _choose(self) -> None:
        state, hand, seen = self.state, self.hand, self.seen
        tube = seen.tube(state.tube)
        point, along = tube.point(state.along), tube.direction(state.along)
        bite = _BITES[self.cuts][state.attempts % len(_BITES[self.cuts])]
        obstacles = seen.obstacles(hand, self.hands, state.tube).near(point)
        spared = seen.spared.near(point) if self.cuts else None
        what = f"{self.params.tubes[state.tube]} {1e3 * state.along:.0f} mm from the gallbladder"
        chosen = partial(
            choose_pose,
            hand,
            away=BEFORE_TUBE,
            opening=opening(hand),
            obstacles=obstacles,
            what=what,
            spared=spared,
        )
        try:
            pose = chosen(jaw_poses(hand, point, along, bite))
        except MotionError:
            pose = chosen(np.concatenate([jaw_poses(hand, point, each, bite) for each in skewed(along)]))
        state.goal[:] = matrix_to_pose(pose)
