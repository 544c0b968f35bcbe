"""Steps at a tube: clips, and the cut between the second and the third."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from math import radians

import numpy as np

from controllers.cholecystectomy.approach import NEAR, choose_pose, hurts, jaw_poses, skewed, withdraw
from controllers.cholecystectomy.grasping import Grasping
from controllers.cholecystectomy.obstacles import Obstacles
from controllers.cholecystectomy.places import STAYS, choose_places, cut_window
from controllers.cholecystectomy.procedure import opening
from controllers.cholecystectomy.sub_task import CUT, Failure, Step
from robots import rotation
from robots.transform import matrix_to_pose, pose_to_matrix
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["Dividing"]

BEFORE_TUBE = 22.0e-3
"""Length of the straight way to a tube, m."""
_BITES = {False: (11.0e-3, 9.0e-3, 12.0e-3, 8.0e-3), True: (8.0e-3, 7.0e-3, 9.0e-3, 6.5e-3)}
"""Distance of the tube from the hinge between the jaws of the applier and of the scissors, by attempt, m.

The ends of the jaws pass the tube, and what lies close behind stays outside. Closing blades push a slack tube
some 6 mm towards their ends.
"""
_FEW = 2
"""How many of these the scissors try in one attempt."""
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


class Dividing(Grasping):
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
        try:
            self._choose()
        except MotionError as error:
            if self.pull_elsewhere(str(error)):
                return
            raise
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
        spared = [self.seen.spared, self.seen.wall] if self.state.spares_wall else [self.seen.spared]
        return hurts(self.hand, pose, Obstacles.join(spared).near(pose[:3, 3], NEAR))

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
        if state.aim >= 0.0:
            return state.aim
        tube, closed = self.seen.tube(state.tube), state.clip_places[state.tube]
        if (closed < 0.0).all():
            eye = self.hands.applier.base[:3, 3]
            state.begins[state.tube] = tube.first_place(self.seen.wall, _FREE, eye)
        places = choose_places(tube.length, float(state.begins[state.tube]))
        if self.cuts:
            window = cut_window(self.closed(state.tube))
            return float(np.mean(window or closed[STAYS - 1 :]))
        outwards = 1.0 if state.job < CUT - 1 else -1.0
        beside = _BESIDE if state.attempts and places.is_roomy else 0.0
        return float(places.beside(closed)[state.job] + outwards * beside)

    def _choose(self) -> None:
        """Choose the pose, and for scissors the place of the cut. Raises MotionError without any."""
        refusal: MotionError | None = None
        for along, bite, wall in self._options():
            try:
                pose = self._pose(along, bite, wall=wall)
            except MotionError as error:
                refusal = refusal or error
                continue
            self.state.along, self.state.spares_wall = along, wall
            self.state.goal[:] = matrix_to_pose(pose)
            return
        assert refusal is not None
        raise refusal

    def _options(self) -> Iterator[tuple[float, float, bool]]:
        """Yield place on the tube and distance from the hinge (m), and if the gallbladder stays uncut."""
        state = self.state
        bites = np.roll(_BITES[self.cuts], -state.attempts).tolist()
        if not self.cuts:
            yield from ((state.along, bite, False) for bite in bites)
            return
        window = cut_window(self.closed(state.tube))
        places = [state.along, *(window or ())]
        for wall in (True, False):
            for place in places:
                yield from ((place, bite, wall) for bite in bites[:_FEW])

    def _pose(self, along: float, bite: float, *, wall: bool) -> Vector:
        """Return the best pose with a place of the tube between the jaws. Raises MotionError without any."""
        hand, seen = self.hand, self.seen
        tube = seen.tube(self.state.tube)
        point, direction = tube.point(along), tube.direction(along)
        chosen = partial(
            choose_pose,
            hand,
            away=BEFORE_TUBE,
            opening=opening(hand),
            obstacles=seen.obstacles(hand, self.hands, self.state.tube).near(point, NEAR),
            what=f"{self.params.tubes[self.state.tube]} {1e3 * along:.0f} mm from the gallbladder",
            spared=seen.spared.near(point, NEAR) if self.cuts else None,
            uncut=seen.wall.near(point, NEAR) if wall else None,
        )
        try:
            return chosen(jaw_poses(hand, point, direction, bite))
        except MotionError:
            return chosen(np.concatenate([jaw_poses(hand, point, each, bite) for each in skewed(direction)]))
