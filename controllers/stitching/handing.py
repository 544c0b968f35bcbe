"""How the needle comes into the jaw that is to drive it, over as many hands as that needs. SI units, world.

A needle is driven by fingers along its axis or against it, and from either side of the wound: that decides
which directions of a stitch an arm can make. A jaw that holds the needle the other way round, or at the wrong
place of its arc, hands it to the other arm, which takes it from the other side; if need be it comes back.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import ceil, pi, radians

import numpy as np

from controllers.expert.hand import Hand, framed
from controllers.stitching.feasibility import reach, room
from controllers.stitching.geometry import Stitch, before
from controllers.stitching.params import StitchParams
from controllers.stitching.phase import Phase
from controllers.stitching.plan import BEFORE, best_grip, driving, grips_of, pulling, require_room
from controllers.stitching.rejoin import BACK
from controllers.stitching.way_on import HandOver, WayOn, raised
from robots import rotation
from schemas.vectors import Vector

__all__ = ["Hold", "handing"]

_APART = radians(45.0)
"""Of the arc: so far from one jaw the other takes hold."""
_HEIGHTS = (0.0, 0.02)
"""m, over the least height at which the needle is handed over."""
_SPINS = 8
"""Orientations of the needle about each axis that are tried for a hand-over."""
_TRIED = 24
"""Ways that are looked at in full, those with the most room where hands meet first."""
_SLICE, _TURN = 5.0e-3, 0.2
"""m and rad: at most between two poses of a line that are looked at."""
_DOWN = 0.7
"""Cosine of the angle between fingers that pick a needle up and straight down, at least."""


@dataclass(frozen=True, eq=False)
class Hold:
    """One way to hold the needle."""

    hand: Hand
    grip: Vector
    """Pose of the tip in the needle's frame, shape (4, 4)."""
    behind: float
    """How far behind the needle's tip, rad of the arc."""


@dataclass(frozen=True, eq=False)
class _Goal:
    """How the needle is driven, and taken."""

    driver: Hold
    puller: Vector
    margin: float
    exchanged: bool
    alone: bool


def handing(
    params: StitchParams, hands: tuple[Hand, Hand], stitch: Stitch, needle: Vector, held: Hold | None
) -> WayOn | None:
    """Return how `stitch` is made with the fewest hand-overs, or None if it cannot be made.

    Args:
        params: how a stitch is made.
        hands: driver and puller; they may exchange their parts.
        stitch: the stitch.
        needle: where the needle is, shape (4, 4), out of the tissue.
        held: by whom and how; None: it lies there.
    """
    search = _Search(params, hands, stitch, needle, held)
    for alone in (False, True):
        goals = search.goals(alone=alone)
        for way in (search.in_hand, search.once, search.twice):
            if (found := way(goals)) is not None:
                return found
    return None


class _Search:
    """What can be looked up while ways are compared."""

    def __init__(
        self,
        params: StitchParams,
        hands: tuple[Hand, Hand],
        stitch: Stitch,
        needle: Vector,
        held: Hold | None,
    ) -> None:
        self._params, self._hands, self._stitch, self._needle, self._held = params, hands, stitch, needle, held
        self._drive = driving(stitch, params.emerge, params.lift)
        self._up = raised(params, needle)
        self._rooms = dict[int, Vector]()
        self._places = _places(stitch, params)

    def goals(self, *, alone: bool) -> list[_Goal]:
        """Return how the stitch can be driven and pulled, by two hands or by one alone, the best first."""
        params, stitch, found = self._params, self._stitch, list[_Goal]()
        require_room(params.grip, stitch, params.emerge)
        pull = pulling(stitch, params.emerge, params.lift)
        for exchanged, driver in enumerate(self._hands):
            puller = driver if alone else self._hands[1 - exchanged]
            taken, pulled, _ = best_grip(puller, _grips(puller, params.taken, stitch), [pull])
            for grip in _grips(driver, params.grip, stitch):
                margin = min(_margin(driver, grip, self._drive), pulled.margin)
                if margin >= 0.0:
                    hold = Hold(driver, grip, params.grip)
                    found.append(_Goal(hold, taken, margin, bool(exchanged), alone))
        return sorted(found, key=lambda goal: -goal.margin)

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
            and _margin(hold.hand, hold.grip, [self._up, self._needle]) >= 0.0
        ]

    @cached_property
    def _holds(self) -> list[Hold]:
        angles = sorted({self._params.grip, (self._params.grip + self._params.taken) / 2.0, self._params.taken})
        return [
            Hold(hand, grip, behind)
            for hand, behind in product(self._hands, angles)
            for grip in _grips(hand, behind, self._stitch)
        ]

    def in_hand(self, goals: Sequence[_Goal]) -> WayOn | None:
        """Return the best way without a hand-over: it is picked up, or held, as it is driven."""
        for goal in goals:
            driver = goal.driver
            for start in self._starts:
                same = start.hand is driver.hand and np.allclose(start.grip, driver.grip)
                if same and self._held is None and self._goes([driver], [], goal):
                    return self._way_on(goal, driver, [], [])
        return None

    def once(self, goals: Sequence[_Goal]) -> WayOn | None:
        """Return the best way with one hand-over."""
        return self._best((start, goal.driver, goal) for goal in goals for start in self._starts)

    def twice(self, goals: Sequence[_Goal]) -> WayOn | None:
        """Return the best way by the other hand and back."""
        return self._best(
            (start, between, goal.driver, goal)
            for goal in goals
            for start in self._starts
            for between in self._holds
        )

    def _best(self, chains: Iterator[tuple[Hold | _Goal, ...]]) -> WayOn | None:
        """Return the first way, in the order of the room where hands meet, that is feasible throughout."""
        scored = list[tuple[float, list[Hold], list[int], _Goal]]()
        for *holds, goal in chains:
            pairs = list(zip(holds, holds[1:], strict=False))
            if not all(_can_meet(*pair) for pair in pairs):
                continue
            rooms = [np.minimum(self._room(giver), self._room(taker)) for giver, taker in pairs]
            at = [int(each.argmax()) for each in rooms]
            margin = min(goal.margin, *(float(each[i]) for each, i in zip(rooms, at, strict=True)))
            if margin >= 0.0:
                scored.append((margin, holds, at, goal))
        scored.sort(key=lambda each: -each[0])
        for _, holds, at, goal in scored[:_TRIED]:
            needles = [self._places[i] for i in at]
            if self._goes(holds, needles, goal):
                return self._way_on(goal, holds[0], needles, holds[1:])
        return None

    def _room(self, hold: Hold) -> Vector:
        """Return what is left of the joints' ranges at each place for a hand-over, shape (n,)."""
        if id(hold) not in self._rooms:
            tips = self._places @ hold.grip
            away = tips.copy()
            away[:, :3, 3] -= BACK * tips[:, :3, 2]
            self._rooms[id(hold)] = np.minimum(*(room(hold.hand.chain, hold.hand.base, each) for each in (tips, away)))
        return self._rooms[id(hold)]

    def _goes(self, holds: Sequence[Hold], needles: Sequence[Vector], goal: _Goal) -> bool:
        """Say whether each hand stays in its joints' ranges from where it takes the needle to where it gives it."""
        begins = [self._needle, *needles]
        for i, hold in enumerate(holds):
            tips = [begins[i] @ hold.grip]
            if i == 0 and self._held is None:
                tips.append(self._up @ hold.grip)
            elif i > 0:
                tips.insert(0, _away(tips[0]))
            if i < len(needles):
                tips = [*_lines(*tips, needles[i] @ hold.grip), _away(needles[i] @ hold.grip)]
            else:
                drive = [pose @ hold.grip for pose in self._drive]
                tips = [*_lines(*tips, drive[0]), *drive[1:]]
            if reach(hold.hand.chain, hold.hand.base, np.array(tips)).margin < 0.0:
                return False
        return goal.margin >= 0.0

    def _way_on(self, goal: _Goal, first: Hold, needles: Sequence[Vector], takers: Sequence[Hold]) -> WayOn:
        handed = tuple(HandOver(needle, taker.grip) for needle, taker in zip(needles, takers, strict=True))
        held = self._held
        return WayOn(
            Phase.HOVER if held is None else Phase.PRESENT,
            None if held is None else held.hand,
            self._needle if held is None else needles[0],
            self._stitch.entry - BEFORE,
            goal.driver.grip,
            goal.puller,
            goal.margin,
            exchanged=goal.exchanged,
            alone=goal.alone,
            handed=handed,
            pick=first.grip,
        )


def _grips(hand: Hand, behind: float, stitch: Stitch) -> list[Vector]:
    """Return all four ways to hold the needle `behind` its tip (rad)."""
    return [
        grip for side in (False, True) for grip in grips_of(hand, behind, stitch.needle, backwards=side)
    ]


def _margin(hand: Hand, grip: Vector, needles: Sequence[Vector]) -> float:
    return reach(hand.chain, hand.base, np.array(needles) @ grip).margin


def _can_meet(giver: Hold, taker: Hold) -> bool:
    return giver.hand is not taker.hand and abs(giver.behind - taker.behind) >= _APART


def _away(tip: Vector) -> Vector:
    """Return a pose of the tip (4, 4) from which it comes to `tip`."""
    return framed(before(tip, BACK))


def _places(stitch: Stitch, params: StitchParams) -> Vector:
    """Return where a needle may be handed over, over the middle of the stitch, shape (n, 4, 4)."""
    up = params.phantom.pose[:3, 2]
    middle = stitch.centre + (params.phantom.pose[:3, 3] - stitch.centre) @ up * up
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
            pose[:3, 3] = middle + (params.lift + stitch.needle.radius + height) * up
            places.append(pose)
    return np.array(places)


def _lines(*tips: Vector) -> Iterator[Vector]:
    """Yield poses (4, 4) on the straight lines from one tip to the next, as a hand goes."""
    for a, b in zip(tips, tips[1:], strict=False):
        turn = rotation.log(rotation.from_matrix(b[:3, :3] @ a[:3, :3].T))
        way = b[:3, 3] - a[:3, 3]
        n = max(1, ceil(np.linalg.norm(way) / _SLICE), ceil(np.linalg.norm(turn) / _TURN))
        for i in range(n):
            pose = np.eye(4)
            pose[:3, :3] = rotation.matrix(rotation.exp(i / n * turn)) @ a[:3, :3]
            pose[:3, 3] = a[:3, 3] + i / n * way
            yield pose
    yield tips[-1]
