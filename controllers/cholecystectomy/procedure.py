"""State of the routine, and what all its steps share."""

from __future__ import annotations

from math import radians
from typing import NamedTuple

import numpy as np

from controllers.cholecystectomy.params import ClipAndCutParams
from controllers.cholecystectomy.sight import Sight
from controllers.cholecystectomy.sub_task import FAILURES, Failure, Step, SubTask
from controllers.cholecystectomy.surgeon_hand import SurgeonHand
from controllers.cholecystectomy.telling import Telling
from hub.participant import Record, array, choice, flag, integer, number
from schemas.vectors import Vector

__all__ = ["GENTLE", "GRASP", "Procedure", "SurgeonHands", "SurgeonState"]

GRASP = -1
"""Number of the tube while the gallbladder is grasped."""
GENTLE = 0.3
"""Share of the speed near tissue."""
OPENING_TIME = 0.4
"""Time for a jaw to open, s."""
_NONE = -1.0


class SurgeonState(Record):
    """State of the routine."""

    sub_task = choice(SubTask.START)
    step = choice(Step.PLAN)
    failure = choice(Failure.NONE)
    reason = choice(Failure.NONE)
    """Why the present sub-task was tried again last."""
    tube = integer(GRASP)
    job = integer()
    """Job on the tube: clip 0 to 2, or cut."""
    goal = array(7)
    """Pose of the tip at the tissue."""
    along = number()
    """Place on the tube at rest, m."""
    attempts = integer()
    """Failed attempts at the present sub-task."""
    aims = integer()
    """Corrections of the present approach."""
    elapsed = number()
    """Time in the step, s."""
    spent = number()
    """Time in the sub-task, s."""
    succeeded = flag()
    """Whether the present attempt has succeeded."""
    slipped = flag()
    """Whether the clip of the present attempt has slipped."""
    second_first = flag()
    """Whether the second tube lies in front of the first, and is clipped and cut first."""
    begins = array(2)
    """Where each tube is free of the gallbladder, m."""
    clip_places = array(2, 3)
    """Place of each clip on its tube at rest, m; -1: none."""
    further = array(2, 4)
    """Place of each further clip on each tube at rest, m; -1: none."""
    aim = number(_NONE)
    """Place of the further clip under way, m; -1: a clip or cut of the plan."""
    leaks = array(2)
    """Place where each tube leaks, m; -1: nowhere."""
    spares_wall = flag()
    """Whether the scissors do not close on the gallbladder."""
    pulls = integer()
    """How often the gallbladder was pulled elsewhere to open a way."""
    swing = number()
    """Way that is left of the present pull elsewhere, m."""
    clips = integer()
    cuts = integer()
    parted = array(2)
    """1 for each parted tube."""
    grasped = flag()
    taut = flag()
    """Whether the gallbladder has been pulled aside for the present tube."""
    pulled = number()
    """Way of the gallbladder, m."""
    slips = integer()
    """Grasps and clips lost later."""
    recoveries = integer()
    rests = array(3, 7)
    """Resting pose of each hand."""
    done = flag()
    failed = flag()


class SurgeonHands(NamedTuple):
    """The three hands."""

    applier: SurgeonHand
    grasper: SurgeonHand
    scissors: SurgeonHand


class Procedure(Telling):
    """The hands, what they see, and the beginning and end of steps."""

    def __init__(self, params: ClipAndCutParams, hands: SurgeonHands) -> None:
        super().__init__()
        self.params, self.hands = params, hands
        self.state = SurgeonState()
        for places in (self.state.clip_places, self.state.further, self.state.leaks):
            places[:] = _NONE
        self.sight: Sight | None = None
        self.fires = False
        """Whether a clip is closed in this step."""

    @property
    def seen(self) -> Sight:
        """The sight of this step."""
        assert self.sight is not None
        return self.sight

    @property
    def hand(self) -> SurgeonHand:
        """The hand at work."""
        if self.state.tube == GRASP:
            return self.hands.grasper
        return self.hands.applier if self.state.job < self.state.clip_places.shape[1] else self.hands.scissors

    def closed(self, tube: int) -> Vector:
        """Return the places of all clips on a tube as they lie, m, shape (n,)."""
        found = np.concatenate([self.state.clip_places[tube], self.state.further[tube]])
        return found[found >= 0.0]

    def enter(self, step: Step) -> None:
        """Begin a step."""
        self.state.step, self.state.elapsed = step, 0.0

    def describe(self) -> str:
        """Return the present sub-task in words."""
        return f"sub-task {self.state.sub_task:d}, {self.state.sub_task.name.lower().replace('_', ' ')}"

    def retry(self, reason: Failure, why: str) -> None:
        """End an attempt that has failed: open the jaw and go back before the tissue, or give up."""
        state = self.state
        state.reason, state.attempts = reason, state.attempts + 1
        if state.attempts >= self.params.attempts:
            self.fail(reason, f"{why}, {state.attempts} attempts")
            return
        state.recoveries += 1
        state.succeeded = False
        self.say(f"{self.describe()}: {FAILURES[reason]}, {why}; it is tried again")
        self.open_jaw()

    def open_jaw(self) -> None:
        """Open the jaw at the tissue."""
        self.hand.stay()
        self.hand.move_jaw(opening(self.hand))
        self.enter(Step.OPEN)

    def fail(self, failure: Failure, why: str) -> None:
        """Give up: all hands stay."""
        state = self.state
        self.give_up(f" in {self.describe()}: {FAILURES[failure]}: {why}", self.hands)
        state.failure, state.failed = failure, True
        state.sub_task = SubTask.FAILED


def opening(hand: SurgeonHand) -> float:
    """Return the angle of the open jaw of a hand, rad."""
    return min(hand.jaw.upper - 0.02, radians(50.0))


def nearest_clip(places: Vector, along: float) -> int | None:
    """Return the number of the clip nearest to a place, of those that are closed; None: none is."""
    apart = np.where(places >= 0.0, np.abs(places - along), np.inf)
    return int(apart.argmin()) if np.isfinite(apart).any() else None
