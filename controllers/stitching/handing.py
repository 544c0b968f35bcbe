"""Search for the hand-overs that bring the needle into the driving jaw. SI units, world.

A needle is driven by fingers along its axis or against it, and from either side of the wound: so an arm can
make only some directions of a stitch. A jaw that holds the needle the wrong way round, or at the wrong
place of the arc, hands the needle to the second arm, from the opposite side; if need be the needle comes
back.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product
from math import pi, radians

import numpy as np

from controllers.expert.hand import RobotHand
from controllers.stitching.feasibility import MARGIN, best_reach, joint_room
from controllers.stitching.gap import ROOM, instrument_gap
from controllers.stitching.geometry import Stitch
from controllers.stitching.itinerary import Itinerary
from controllers.stitching.params import StitchParams
from controllers.stitching.phase import StitchPhase
from controllers.stitching.plan import BEFORE, driving_poses, grips_of, pulling_poses, require_room
from controllers.stitching.rejoin import BACK
from controllers.stitching.way_on import HandOver, WayOn, raise_needle
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["Handing", "Hold"]

_APART = radians(45.0)
"""Arc between the two jaws at a hand-over."""
_HEIGHTS = (0.0, 0.02)
"""Heights over the least height of a hand-over, m."""
_NEARER = 0.5
"""To the surgeon, of the height over the skin."""
_SPINS = 8
"""Orientations of the needle about each axis tried for a hand-over."""
_TRIED = 24
"""Ways examined in full; the most room at a hand-over comes first."""
_JAW = 0.012
"""Reach of a jaw from its tip frame, and 2 mm, m."""
_DOWN = 0.7
"""Least cosine of the angle between picking fingers and straight down."""


@dataclass(frozen=True, eq=False)
class Hold:
    """A way to hold the needle."""

    hand: RobotHand
    grip: Vector
    """Pose of the tip in the needle's frame, shape (4, 4)."""
    behind: float
    """How far behind the needle's tip, rad of the arc."""


@dataclass(frozen=True, eq=False)
class _Goal:
    """How the needle is driven, and taken."""

    driver: Hold
    puller: RobotHand
    pullers: tuple[Vector, ...]
    """Possible grips of the puller."""
    margin: float
    exchanged: bool
    alone: bool


class Handing:
    """The search for a way with the fewest hand-overs.

    Args:
        params: how a stitch is made.
        hands: driver and puller; the hands may exchange their parts.
        stitch: the stitch.
        needle: pose of the needle, shape (4, 4), out of the tissue.
        held: hand and grip; None: the needle lies in the scene.
        rests: poses of the resting tips of the hands, shape (2, 7).
    """

    def __init__(
        self,
        params: StitchParams,
        hands: tuple[RobotHand, RobotHand],
        stitch: Stitch,
        needle: Vector,
        held: Hold | None,
        rests: Vector,
    ) -> None:
        self._params, self._hands, self._stitch = params, hands, stitch
        self._needle, self._held, self._rests = needle, held, rests
        self._drive = np.array(driving_poses(stitch, params.emerge, params.lift))
        self._pull = np.array(pulling_poses(stitch, params.emerge, params.lift))
        self._up = raise_needle(params, needle)
        self._rooms = dict[Hold, Vector]()
        self._meetings = dict[tuple[Hold, Hold], Vector]()
        self._places = _places(stitch, params)

    def plan(self) -> WayOn | None:
        """Return how the stitch is made; None if there is no way."""
        for alone in (False, True):
            goals = self._goals(alone=alone)
            for way in (self._in_hand, self._one_handover, self._two_handovers):
                if (found := way(goals)) is not None:
                    return found
        return None

    def _goals(self, *, alone: bool) -> list[_Goal]:
        """Return how the stitch can be driven and pulled, by two hands or by a hand alone, the best first."""
        params, stitch, found = self._params, self._stitch, list[_Goal]()
        require_room(params.grip, stitch, params.emerge)
        for exchanged, driver in enumerate(self._hands):
            puller = driver if alone else self._hands[1 - exchanged]
            grips = _four_grips(puller, params.taken, stitch)
            taken = tuple(grip for grip in grips if _joint_margin(puller, grip, self._pull) >= MARGIN)
            for hold in self._driver_holds(driver) if taken else ():
                margin = _joint_margin(driver, hold.grip, self._drive)
                if margin >= MARGIN:
                    found.append(_Goal(hold, puller, taken, margin, bool(exchanged), alone))
        return sorted(found, key=lambda goal: -goal.margin)

    def _driver_holds(self, driver: RobotHand) -> list[Hold]:
        """Return the holds of a driving hand: the present hold, or the hold of the parameters."""
        params, stitch, held = self._params, self._stitch, self._held
        holds = [Hold(driver, grip, params.grip) for grip in _four_grips(driver, params.grip, stitch)]
        if held is not None and held.hand is driver:
            with suppress(MotionError):
                require_room(held.behind, stitch, params.emerge)
                return [held, *holds]
        return holds

    @cached_property
    def _starts(self) -> list[Hold]:
        """How the needle is held, or can be picked up."""
        if self._held is not None:
            return [self._held]
        up = self._params.phantom.pose[:3, 2]
        return [
            hold
            for hold in self._holds
            if -(self._needle[:3, :3] @ hold.grip[:3, 2]) @ up > _DOWN
            and _joint_margin(hold.hand, hold.grip, np.stack([self._up, self._needle])) >= MARGIN
        ]

    @cached_property
    def _holds(self) -> list[Hold]:
        grip, taken = self._params.grip, self._params.taken
        angles = (taken, (grip + taken) / 2.0, grip)
        return [
            Hold(hand, grip, behind)
            for hand, behind in product(self._hands, angles)
            for grip in _four_grips(hand, behind, self._stitch)
        ]

    def _in_hand(self, goals: Sequence[_Goal]) -> WayOn | None:
        """Return the best way without a hand-over: the needle is picked up, or held, as for the drive."""
        for goal, start in product(goals, self._starts):
            same = start.hand is goal.driver.hand and np.allclose(start.grip, goal.driver.grip)
            if same and (found := self._along([start], [], goal)) is not None:
                return found
        return None

    def _one_handover(self, goals: Sequence[_Goal]) -> WayOn | None:
        """Return the best way with a single hand-over."""
        return self._best_way(((start, goal.driver), goal) for goal in goals for start in self._starts)

    def _two_handovers(self, goals: Sequence[_Goal]) -> WayOn | None:
        """Return the best way by the second hand and back."""
        return self._best_way(
            ((start, between, goal.driver), goal)
            for goal in goals
            for start in self._starts
            for between in self._holds
        )

    def _best_way(self, chains: Iterator[tuple[Sequence[Hold], _Goal]]) -> WayOn | None:
        """Return the first way, in the order of the room at the hand-over, feasible throughout."""
        scored = list[tuple[float, Sequence[Hold], list[int], _Goal]]()
        for holds, goal in chains:
            pairs = list(pairwise(holds))
            if not all(_can_meet(*pair) for pair in pairs):
                continue
            rooms = [self._meeting_room(giver, taker) for giver, taker in pairs]
            at = [int(each.argmax()) for each in rooms]
            margin = min(goal.margin, *(float(each[i]) for each, i in zip(rooms, at, strict=True)))
            if margin >= MARGIN:
                scored.append((margin, holds, at, goal))
        scored.sort(key=lambda each: -each[0])
        for _, holds, at, goal in scored[:_TRIED]:
            if (found := self._along(holds, [self._places[i] for i in at], goal)) is not None:
                return found
        return None

    def _place_room(self, hold: Hold) -> Vector:
        """Return the free share of the joints' ranges at each place for a hand-over, shape (n,)."""
        if hold not in self._rooms:
            tips = self._places @ hold.grip
            away = tips.copy()
            away[:, :3, 3] -= BACK * tips[:, :3, 2]
            chain, base = hold.hand.chain, hold.hand.base
            self._rooms[hold] = np.minimum(joint_room(chain, base, tips), joint_room(chain, base, away))
        return self._rooms[hold]

    def _meeting_room(self, giver: Hold, taker: Hold) -> Vector:
        """Return the lesser room of both at each place, shape (n,); -1 where the instruments would meet."""
        key = giver, taker
        if key not in self._meetings:
            rooms = np.minimum(self._place_room(giver), self._place_room(taker))
            at = np.flatnonzero(rooms >= 0.0)
            there = self._places[at]
            gaps = instrument_gap(giver.hand, there @ giver.grip, taker.hand, there @ taker.grip)
            rooms[at[gaps < ROOM]] = -1.0
            self._meetings[key] = rooms
        return self._meetings[key]

    def _along(self, holds: Sequence[Hold], needles: Sequence[Vector], goal: _Goal) -> WayOn | None:
        """Return a way, if the joints of both hands can follow from their present positions to the end."""
        going = {hand: Itinerary(hand) for hand in self._hands}
        rests = dict(zip(self._hands, self._rests, strict=True))
        first, driver = holds[0], goal.driver
        if self._held is None:
            going[first.hand].take_hold(self._needle, first.grip)
            going[first.hand].lead(self._up, first.grip)
        for giver, taker, needle in zip(holds, holds[1:], needles, strict=False):
            going[giver.hand].lead(needle, giver.grip)
            going[taker.hand].take_hold(needle, taker.grip)
            going[giver.hand].leave(rests[giver.hand])
        going[driver.hand].lead(self._drive[0], driver.grip)
        going[driver.hand].follow(self._drive[1:], driver.grip)
        going[driver.hand].leave(None if goal.alone else rests[driver.hand])
        other = next(hand for hand in self._hands if hand is not goal.puller)
        at_least = going[other].margin
        if at_least < MARGIN or not self._is_clear(going):
            return None
        for grip in goal.pullers:
            if not (goal.alone or self._can_take_out(driver, goal.puller, grip)):
                continue
            pulling = going[goal.puller].copy()
            pulling.take_hold(self._drive[-1], grip)
            pulling.follow(self._pull, grip)
            margin = min(at_least, pulling.margin)
            if margin >= MARGIN:
                return self._way_on(goal, first, grip, needles, holds[1:], margin)
        return None

    def _can_take_out(self, driver: Hold, puller: RobotHand, grip: Vector) -> bool:
        """Return whether the puller can take the needle after its exit, beside the driver."""
        end = self._drive[-1:]
        return bool(instrument_gap(driver.hand, end @ driver.grip, puller, end @ grip)[0] >= ROOM)

    def _is_clear(self, going: dict[RobotHand, Itinerary]) -> bool:
        """Return whether each hand with the needle keeps away from the resting place of the second hand."""
        least = self._stitch.needle.radius + _JAW
        places = zip(self._hands[::-1], self._rests, strict=True)
        return all(going[hand].distance(rest[:3]) > least for hand, rest in places)

    def _way_on(
        self,
        goal: _Goal,
        first: Hold,
        puller: Vector,
        needles: Sequence[Vector],
        takers: Sequence[Hold],
        margin: float,
    ) -> WayOn:
        handed = tuple(HandOver(needle, taker.grip) for needle, taker in zip(needles, takers, strict=True))
        if self._held is None:
            phase, holder, where = StitchPhase.HOVER, None, self._needle
        else:
            phase, holder = StitchPhase.PRESENT if handed else StitchPhase.LIFT, self._held.hand
            where = needles[0] if handed else self._up
        return WayOn(
            phase,
            holder,
            where,
            self._stitch.entry - BEFORE,
            goal.driver.grip,
            puller,
            margin,
            exchanged=goal.exchanged,
            alone=goal.alone,
            handed=handed,
            pick=first.grip,
        )


def _four_grips(hand: RobotHand, behind: float, stitch: Stitch) -> list[Vector]:
    """Return all four holds of the needle `behind` its tip (rad)."""
    return [grip for side in (False, True) for grip in grips_of(hand, behind, stitch.needle, backwards=side)]


def _joint_margin(hand: RobotHand, grip: Vector, needles: Vector) -> float:
    return best_reach(hand.chain, hand.base, needles @ grip).margin


def _can_meet(giver: Hold, taker: Hold) -> bool:
    return giver.hand is not taker.hand and abs(giver.behind - taker.behind) >= _APART


def _places(stitch: Stitch, params: StitchParams) -> Vector:
    """Return the places for a hand-over, shape (n, 4, 4).

    The places are on the way from the middle of the pad to the endoscope, on the surgeon's side, y < 0.
    """
    middle, up = params.phantom.pose[:3, 3], params.phantom.pose[:3, 2]
    to_eyes = up - _NEARER * params.phantom.pose[:3, 1]
    axes = np.array([axis for axis in product((-1.0, 0.0, 1.0), repeat=3) if any(axis)])
    places = list[Vector]()
    for axis in axes / np.linalg.norm(axes, axis=1, keepdims=True):
        across = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
        across /= np.linalg.norm(across)
        for spin, height in product(range(_SPINS), _HEIGHTS):
            turn = 2.0 * pi * spin / _SPINS
            pose = np.eye(4)
            pose[:3, 0] = np.cos(turn) * across + np.sin(turn) * np.cross(axis, across)
            pose[:3, 1] = np.cross(axis, pose[:3, 0])
            pose[:3, 2] = axis
            pose[:3, 3] = middle + (params.lift + stitch.needle.radius + height) * to_eyes
            places.append(pose)
    return np.array(places)
