"""The procedure of a stitch led by a person: the person picks the points, and consents before any motion.

Pause and resume are a pace between 0 and 1 at which the procedure's own time passes. After a take-over, and
after a failure, the stitch is planned anew from where needle and hands are: the free hand opens and goes
clear, then each hand goes on a line from the present setpoint to where the procedure goes on.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from hashlib import blake2b
from math import cos, radians, sin

import numpy as np

from controllers.expert.hand import RobotHand
from controllers.stitching.geometry import Stitch
from controllers.stitching.handing import Handing
from controllers.stitching.params import StitchParams
from controllers.stitching.phase import StitchPhase
from controllers.stitching.plan import stitch_through
from controllers.stitching.procedure import Procedure
from controllers.stitching.stage import COMMANDS, Stage
from controllers.stitching.way_on import WayOn, is_inside, way_on
from hub.participant import Record, array, choice, flag, integer, number
from robots.transform import inverse_transform
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["GuidedSurgeon"]

_ABOVE = 5.0e-3
"""Distance from the skin up to which a point counts as on the skin, m."""
_LEAST = 2.0e-3
"""m; of a bite."""
_TURNS = (15, -15, 30, -30, 45, -45, 60, -60, 90, -90, 135, -135, 180)
"""Turns about the skin's normal to try for a stitch that is not feasible, degrees; least first."""
_HANDED = ("", ", handed over once", ", handed over twice")
_NAME_BYTES = 4
"""Size of the hash of a proposal's name: eight digits to type."""
_RAMP = 0.2
"""Time in which a pause stops all motion, s."""
_MOVED, _TURNED = 0.5e-3, 0.01
"""m, and of a quaternion's parts: a hand this far from its paused place was moved by somebody."""


class GuidedState(Record):
    """The points and words of a person, and the progress of the stitch."""

    stage = choice(Stage.PICKING)
    picked = integer()
    """Number of points: entry, exit."""
    points = array(2, 3)
    """Entry and exit on the skin, in the phantom's frame."""
    pace = number()
    """Pace of the procedure's time, 0 to 1."""
    begun = flag()


class GuidedSurgeon(Procedure):
    """Two hands, a needle and a person."""

    def __init__(self, params: StitchParams, driver: RobotHand, puller: RobotHand) -> None:
        super().__init__(params, driver, puller)
        self.guided = GuidedState()
        self._setpoints = np.zeros((2, 7))
        self.led = False
        """Whether a person's hand leads an arm now."""
        self.sure = True
        """Whether the places of the tips are known."""

    @property
    def stitch(self) -> Stitch:
        """The stitch through the picked points. Raises MotionError if the stitch is not feasible."""
        phantom, (entry, leave) = self.params.phantom, self.guided.points
        return stitch_through(phantom.measures, phantom.pose, entry, leave, self._needle, "the stitch")

    @property
    def moves_arms(self) -> bool:
        """Whether the procedure commands the arms in this step."""
        return self.guided.pace > 0.0

    def measure(self, setpoints: Vector, *, led: bool) -> None:
        """Take the setpoints of both tips in the world, shape (2, 7), and whether a hand leads an arm."""
        self._setpoints[:], self.led = setpoints, led
        if not self.guided.begun:
            self.guided.begun, self.state.park[:] = True, setpoints
            self._enter(StitchPhase.DONE)

    def pick(self, point: Vector) -> None:
        """Store the next point, shape (3,), in the world: an entry, then an exit, then the next entry.

        Raises MotionError for a point off the skin, or outside the time to pick.
        """
        guided, phantom = self.guided, self.params.phantom
        if guided.stage in (Stage.RUNNING, Stage.PAUSED):
            raise MotionError("a stitch is being made: pause and cancel it before the next one is picked")
        where = (inverse_transform(phantom.pose) @ [*point, 1.0])[:3]
        if abs(where[2]) > _ABOVE:
            raise MotionError(
                f"the point is {where[2] * 1e3:.1f} mm above the skin, allowed are {_ABOVE * 1e3:.0f} either"
                " way"
            )
        where[2] = 0.0
        is_exit = guided.picked == 1
        if is_exit and (bite := float(np.linalg.norm(where - guided.points[0]))) < _LEAST:
            raise MotionError(f"entry and exit are {bite * 1e3:.1f} mm apart, at least {_LEAST * 1e3:.0f}")
        guided.points[int(is_exit)] = where
        guided.picked = 1 + is_exit
        guided.stage = Stage.PICKING
        if is_exit:
            self._propose_plan()
        else:
            self._status.append("the entry is picked, the exit is next")

    def _propose_plan(self) -> None:
        try:
            plan = self._way_on()
        except MotionError as error:
            hint = self._feasible_turn()
            self.guided.picked = 0
            raise MotionError(f"{error}{hint}") from error
        self.guided.stage = Stage.PROPOSED
        self._status.append(self._question_text(plan))

    def _question_text(self, plan: WayOn) -> str:
        """Return the question whether a person consents to a plan, with the plan's name."""
        who = self.hands[plan.exchanged].arm
        pulls, over = " and pulls" if plan.alone else "", _HANDED[len(plan.handed)]
        left = f"{plan.margin:.2f} of the joints' ranges left"
        return f"consent {self._name(plan)}? {who} drives{pulls}{over}; {left}"

    def _name(self, plan: WayOn) -> str:
        """Return the name of a plan: a hash of the picked points and of the parts of the arms."""
        roles = bytes([plan.exchanged, plan.alone, len(plan.handed)])
        return blake2b(self.guided.points.tobytes() + roles, digest_size=_NAME_BYTES).hexdigest()

    def _accept_consent(self, name: str) -> None:
        """Start the proposal of this name. Raises MotionError if another proposal is valid now."""
        plan = self._way_on()
        if name != (proposed := self._name(plan)):
            self._status.append(self._question_text(plan))  # what is shown last is the question
            raise MotionError(f"a consent to '{name:.40}', but '{proposed}' is proposed")
        self._go_on(plan)

    def _feasible_turn(self) -> str:
        """Return the least turn about its middle by which the picked stitch becomes feasible; empty: none."""
        points = self.guided.points
        picked, middle = points.copy(), points.mean(axis=0)
        try:
            for turn in _TURNS:
                c, s = cos(radians(turn)), sin(radians(turn))
                points[:] = middle + (picked - middle) @ np.array(
                    [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]
                )
                with suppress(MotionError):
                    self._way_on()
                    return f"; turned by {turn:+d} degrees about its middle it is feasible"
        finally:
            points[:] = picked
        return ""

    def command(self, word: str) -> None:
        """Execute a word of a person: a member of COMMANDS, `consent` with the name of a proposal.

        Raises MotionError for a word that cannot be executed now.
        """
        guided, word = self.guided, word.strip().lower()
        if word.startswith("consent "):
            word, _, name = word.partition(" ")
        else:
            name = ""
        if word not in COMMANDS:
            raise MotionError(f"'{word}' is no command, allowed: {', '.join(COMMANDS)}")
        if guided.stage not in COMMANDS[word]:
            allowed = ", ".join(name for name, stages in COMMANDS.items() if guided.stage in stages)
            raise MotionError(f"'{word}' while {_stage_words(guided.stage)}, allowed: {allowed}")
        if word == "pause":
            self._stage(Stage.PAUSED)
        elif word == "take over":
            self.take_over()
        elif word == "cancel":
            guided.picked = 0
            self.rejoin.give_up()
            self._enter(StitchPhase.DONE)
            self._stage(Stage.PICKING)
        elif self.led:
            raise MotionError(f"'{word}' while a hand leads an arm: release it first")
        elif guided.stage is Stage.PAUSED and self._is_where_it_paused:
            self._stage(Stage.RUNNING)
        elif word == "consent":
            self._accept_consent(name.strip())
        else:
            self._go_on(self._way_on())

    def take_over(self) -> None:
        """Command nothing from now on: the arms are in a person's hands."""
        self._stage(Stage.TAKEN_OVER)
        self.guided.pace = 0.0

    def _stage(self, stage: Stage) -> None:
        self.guided.stage = stage
        self._status.append(_stage_words(stage))

    @property
    def _is_where_it_paused(self) -> bool:
        for hand, setpoint in zip(self.hands, self._setpoints, strict=True):
            off = hand.line() - setpoint
            off[:3] += hand.state.correction
            turned = min(np.abs(off[3:]).max(), np.abs(off[3:] + 2.0 * setpoint[3:]).max())
            if np.abs(off[:3]).max() > _MOVED or turned > _TURNED:
                return False
        return True

    def _way_on(self) -> WayOn:
        if self.guided.picked < len(self.guided.points):
            raise MotionError("no stitch is picked: entry and exit are needed")
        if not self.sure:
            raise MotionError("the cameras have not yet seen well enough where the tips are")
        params, state, stitch = self.params, self.state, self.stitch
        if is_inside(params, state.needle):
            hands = (self.driver, self.puller)
            plan = way_on(params, *hands, stitch, state.needle, state.holder)
            return replace(plan, exchanged=self.handing.exchanged, alone=self.handing.alone)
        plan = Handing(params, self.hands, stitch, state.needle, self._present_hold, state.park).plan()
        if plan is None:
            super()._way_on()  # says which joint fails
            raise MotionError(
                "the stitch is not feasible from where the arms are: a shaft would have to turn farther than"
                " it can, or the arms would meet"
            )
        return plan

    def _go_on(self, plan: WayOn) -> None:
        """Send the hands to the beginning of a plan, each from the present setpoint."""
        for hand, setpoint in zip(self.hands, self._setpoints, strict=True):
            hand.state.correction[:] = 0.0
            hand.state.start[:] = hand.state.goal[:] = setpoint
            hand.state.duration = hand.state.elapsed = 0.0
        self._follow(plan)
        self._stage(Stage.RUNNING)

    def step(self) -> None:
        """Let time pass at the present pace, and advance the procedure."""
        guided, share = self.guided, self.driver.period / _RAMP
        if self.led and guided.stage in (Stage.RUNNING, Stage.PAUSED, Stage.STOPPED):
            self.take_over()
        wanted = 1.0 if guided.stage is Stage.RUNNING else 0.0
        guided.pace += min(max(wanted - guided.pace, -share), share)
        for hand in self.hands:
            hand.period *= guided.pace
        if guided.pace > 0.0:
            super().step()

    def _begin(self) -> None:
        """Do nothing: a person's points are the beginning."""

    def _raise(self) -> None:
        """Let the puller hold the needle over the skin until the next stitch is picked."""
        if self._has_arrived(self.puller):
            self.state.made[0] += 1.0
            self.guided.picked = 0
            self._enter(StitchPhase.DONE)
            self._stage(Stage.PICKING)

    def _recover(self, why: str) -> None:
        """Stop: a person decides whether the stitch goes on."""
        self._fail(f"{why}; say 'resume' to let it go on from there")

    def _fail(self, why: str) -> None:
        self.state.failed[0], self.guided.stage = 1.0, Stage.STOPPED
        self._status.append(f"stopped: {why}")
        self._enter(StitchPhase.FAILED)


def _stage_words(stage: Stage) -> str:
    return stage.name.lower().replace("_", " ")
