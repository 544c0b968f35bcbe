"""Engagement of arm and hand: by buttons, the arm's operating state and the age of the hand's pose.

After the states of mtsTeleOperationPSM.cpp (jhu-dvrk/sawIntuitiveResearchKit): the arm must be ENABLED and
homed and the hand's pose be fresh; then the hand is aligned, then the arm follows. A clutch frees the hand;
the hand is aligned again before taking over. If any of these conditions ends, the arm holds.
"""

from __future__ import annotations

from enum import IntEnum

from controllers.teleoperation.alignment import AlignmentGate
from controllers.teleoperation.params import TeleoperationParams
from hub.participant import Record, choice, flag
from robots import rotation
from robots.dvrk.crtk import is_ready
from schemas.crtk import OperatingState
from schemas.ros import Joy
from schemas.vectors import Vector

__all__ = ["Engagement", "EngagementPhase"]


class EngagementPhase(IntEnum):
    """Phase of the engagement."""

    DISABLED = 0
    """The arm holds: not ready, or the hand's pose is not fresh."""
    CLUTCHED = 1
    """The arm holds: the hand is free."""
    ALIGNING = 2
    """The arm holds until the hand has the tip's orientation."""
    ENABLED = 3
    """The arm follows."""


class EngagementState(Record):
    """State of the engagement, without the alignment gate."""

    phase = choice(EngagementPhase.DISABLED)
    pressed = flag()
    """The clutch button."""
    interrupted = flag()
    """Whether the hand was free in this step."""
    not_ready = flag()
    """Whether the arm has published a state other than ENABLED and homed."""
    lost = flag()
    """Whether the hand's pose was not fresh in the last step."""


class Engagement:
    """Whether the arm follows."""

    def __init__(self, params: TeleoperationParams) -> None:
        self._arm, self._max_age = params.arm, params.max_age
        self._clutch, self._must_hold = params.buttons.clutch, params.engage == "held"
        self._gate = AlignmentGate() if params.align == "gate" else None
        self._now = EngagementState()
        self.state = (self._now,) if self._gate is None else (self._now, self._gate.state)
        self.exchanging = False
        """Whether the arm's instrument is exchanged in this step."""
        self.takes_over = False
        """Whether the arm begins to follow in this step and needs a reference."""
        self.warnings: list[str] = []
        """Warnings of the last step."""

    @property
    def phase(self) -> EngagementPhase:
        """Phase in this step."""
        return self._now.phase

    @property
    def arm_is_ready(self) -> bool:
        """Whether the arm is ENABLED and homed, by the last published state, and holds an instrument."""
        return not (self._now.not_ready or self.exchanging)

    def receive_state(self, message: OperatingState) -> None:
        """Read the operating state of the arm."""
        self._now.not_ready = not is_ready(message)

    def receive_buttons(self, joy: Joy) -> None:
        """Read the clutch.

        A press and release inside a step still frees the hand; a Joy without the clutch's button changes
        nothing.
        """
        if joy.buttons.size > self._clutch:
            self._now.pressed = bool(joy.buttons[self._clutch] != 0)
            if self._is_free:
                self._now.interrupted = True

    @property
    def _is_free(self) -> bool:
        return self._now.pressed is not self._must_hold

    def step(
        self, to_base: Vector, hand: Vector, tip: Vector, gripper: float, h: float, *, fresh: bool
    ) -> None:
        """Decide on this step.

        Args:
            to_base: orientation of the master's base frame in the arm's, quaternion (x, y, z, w).
            hand: orientation of the master in its base frame, likewise.
            tip: orientation of the tip in the arm's base frame, likewise.
            gripper: gripper of the master, 0 closed .. 1 open; negative: no gripper.
            h: the step, s.
            fresh: whether the hand's pose is fresh.
        """
        self.warnings = []
        now, before = self._now, self._now.phase
        if fresh is now.lost:  # it was not, or is no longer
            if self._must_hold and not fresh:
                now.pressed = False  # until the button is received again
            now.lost = not fresh
        phase = self._decide_phase(to_base, hand, tip, gripper, h, fresh=fresh)
        if phase is not before:
            now.phase = phase
        if phase is EngagementPhase.DISABLED and before is not EngagementPhase.DISABLED:
            again = ": let go of the dead-man, and hold it again" if self._must_hold else ""
            reason = (
                f"its master has been silent for more than {self._max_age / 1e6:g} ms{again}"
                if self.arm_is_ready
                else "its instrument is exchanged"
                if self.exchanging
                else "it is not ENABLED and homed"
            )
            self.warnings.append(f"{self._arm} holds: {reason}")
        interrupted = now.interrupted
        self.takes_over = phase is EngagementPhase.ENABLED and (
            before is not EngagementPhase.ENABLED or interrupted
        )
        if interrupted:
            now.interrupted = False

    def _decide_phase(
        self, to_base: Vector, hand: Vector, tip: Vector, gripper: float, h: float, *, fresh: bool
    ) -> EngagementPhase:
        gate = self._gate
        if not (fresh and self.arm_is_ready):
            if gate is not None:
                gate.reset()
            return EngagementPhase.DISABLED
        if gate is not None and self._now.interrupted:
            gate.clutch()
        if self._is_free:
            return EngagementPhase.CLUTCHED
        if (
            gate is None
            or (self.phase is EngagementPhase.ENABLED and not self._now.interrupted)
            or gate.check(rotation.product(to_base, hand), tip, gripper, h)
        ):
            return EngagementPhase.ENABLED
        if warning := gate.warning():
            self.warnings.append(f"{self._arm} waits: {warning}")
        return EngagementPhase.ALIGNING
