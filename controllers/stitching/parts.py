"""The parts of driver and puller; the two hands of a stitch may exchange them. SI units."""

from __future__ import annotations

from controllers.expert.hand import RobotHand
from controllers.stitching.phase import StitchPhase
from controllers.stitching.way_on import WayOn
from hub.participant import Record, array, choice, flag, integer, number

__all__ = ["HandingState", "Parts", "ProcedureState"]


class ProcedureState(Record):
    """Everything in the procedure that changes."""

    phase = choice(StitchPhase.BEGIN)
    stitch = integer(1)
    """Number of the pair of holes at work."""
    attempts = integer()
    """To take hold of the needle, in succession."""
    recoveries = integer()
    """Recoveries from a lost needle in this stitch."""
    free = flag()
    """Whether no jaw is to hold the needle, though a hand holds the needle in this phase."""
    picked_for = choice(StitchPhase.LIFT)
    """Phase after the driver has taken the needle up."""
    waited = number()
    """s since the hand at work has arrived."""
    unheld = number()
    """Time without a holder of the needle, s."""
    needle = array(4, 4)
    holder = number()
    grip = array(4, 4)
    """Pose of the holding hand's tip in the needle's frame."""
    planned = array(2, 4, 4)
    """Planned grips of driver and puller."""
    park = array(2, 7)
    """Resting poses of the hands."""
    angle = array(1)
    """Commanded angle of the needle's tip on its way, rad."""
    deviation = array(1)
    """Deviation of the measured needle from its way, m."""
    made = array(1)
    done = array(1)
    failed = array(1)


class HandingState(Record):
    """The parts of the hands, and the hand-overs into the driving jaw."""

    exchanged = flag()
    """Whether driver and puller have exchanged their parts."""
    alone = flag()
    """Whether the driver pulls, too."""
    pending = flag()
    """Whether the picked needle is handed over before the drive."""
    left = integer()
    """Hand-overs after the next one: after an even number the driver has the needle."""
    needles = array(2, 4, 4)
    """Where the needle is handed over, the last place first."""
    between = array(4, 4)
    """Grip of the puller before giving the needle back."""
    pick = array(4, 4)
    """Grip for picking up, in case of a hand-over."""


class Parts:
    """Two hands, and the part of each in every phase of a stitch."""

    def __init__(self, hands: tuple[RobotHand, RobotHand]) -> None:
        self.hands = hands
        self.state, self.handing = ProcedureState(), HandingState()

    @property
    def driver(self) -> RobotHand:
        """The driving hand."""
        return self.hands[self.handing.exchanged]

    @property
    def puller(self) -> RobotHand:
        """The pulling hand."""
        return self.driver if self.handing.alone else self._second_hand(self.driver)

    @property
    def settles(self) -> tuple[bool, bool]:
        """Whether the tips of the hands are to be brought exactly to their goals."""
        phase = self.state.phase
        if phase in (StitchPhase.HOVER, StitchPhase.DESCEND):
            at_work = self._picker
        elif phase in (StitchPhase.ALIGN, StitchPhase.DRIVE):
            at_work = self.driver
        elif phase in (StitchPhase.COME, StitchPhase.TAKE, StitchPhase.COME_BACK, StitchPhase.TAKE_BACK):
            at_work = self._next_taker
        else:
            at_work = self.puller if phase is StitchPhase.PULL else None
        return self.hands[0] is at_work, self.hands[1] is at_work

    @property
    def _holding(self) -> RobotHand | None:
        phase = self.state.phase
        if self.state.free:
            return None
        if phase is StitchPhase.LIFT:
            return self._picker
        if phase is StitchPhase.LEAVE_BACK:
            return self._next_taker
        if StitchPhase.PRESENT <= phase <= StitchPhase.HOLD_BACK:
            return self._giver
        if StitchPhase.APPROACH <= phase <= StitchPhase.HOLD:
            return self.driver
        return self.puller if StitchPhase.LEAVE <= phase <= StitchPhase.RAISE else None

    @property
    def _next_taker(self) -> RobotHand:
        """The next taker of the needle."""
        if self.handing.pending or StitchPhase.PRESENT <= self.state.phase <= StitchPhase.LEAVE_BACK:
            return self._second_hand(self.driver) if self.handing.left % 2 else self.driver
        return self.puller

    @property
    def _giver(self) -> RobotHand:
        """The giving hand."""
        return self._second_hand(self._next_taker)

    def _second_hand(self, hand: RobotHand) -> RobotHand:
        return self.hands[hand is self.hands[0]]

    @property
    def _picker(self) -> RobotHand:
        """The picking hand."""
        return self._giver if self.handing.pending else self.driver

    def _assign(self, plan: WayOn) -> None:
        """Assign the parts of a plan to the hands."""
        handing, handed = self.handing, plan.handed
        handing.exchanged, handing.alone = plan.exchanged, plan.alone
        handing.left = max(0, len(handed) - 1)
        handing.pending = bool(handed) and plan.phase is StitchPhase.HOVER
        for i, each in enumerate(reversed(handed)):
            handing.needles[i] = each.needle
        if len(handed) > 1:
            handing.between[:] = handed[-2].grip
        if plan.pick is not None:
            handing.pick[:] = plan.pick
