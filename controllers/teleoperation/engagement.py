"""Who leads: from buttons, the arm's operating state and the age of the hand's pose to whether the arm
follows.

After the states of mtsTeleOperationPSM.cpp (jhu-dvrk/sawIntuitiveResearchKit): the arm must be ENABLED and
homed and the hand be heard, then be aligned, then the arm follows; a clutch frees the hand, which is aligned
anew when it takes over again. Whatever has gone, the arm holds.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from controllers.teleoperation.alignment import AlignmentGate
from controllers.teleoperation.params import TeleoperationParams
from schemas.crtk import OperatingState
from schemas.ros import Joy
from schemas.vectors import Vector

__all__ = ["Engagement", "Phase"]


class Phase(IntEnum):
    """What the arm does."""

    DISABLED = 0
    """It holds: it is not ready, or the hand is not heard."""
    CLUTCHED = 1
    """It holds: the hand is free."""
    ALIGNING = 2
    """It holds until the hand is turned as it is."""
    ENABLED = 3
    """It follows."""


class Engagement:
    """Whether the arm follows. All that changes is in `state`."""

    def __init__(self, params: TeleoperationParams) -> None:
        """Take which button is the clutch, and what is asked of the hand."""
        self._arm, self._max_age = params.arm, params.max_age
        self._clutch, self._must_hold = params.buttons.clutch, params.engage == "held"
        self._gate = AlignmentGate() if params.align == "gate" else None
        self._memory = np.zeros(5)
        self._phase, self._pressed, self._interrupted, self._not_ready, self._lost = np.split(self._memory, 5)
        self.state = (self._memory,) if self._gate is None else (self._memory, self._gate.state)
        self.takes_over = False
        """Whether the arm begins to follow in this step, so that a reference must be taken."""
        self.warnings: list[str] = []
        """Of the last step."""

    @property
    def phase(self) -> Phase:
        """What the arm does in this step."""
        return Phase(int(self._phase[0]))

    @property
    def arm_is_ready(self) -> bool:
        """Whether the arm is ENABLED and homed, as far as anybody has told."""
        return not self._not_ready[0]

    def hear_arm(self, message: OperatingState) -> None:
        """Take what the arm says of itself."""
        self._not_ready[0] = message.state != "ENABLED" or not message.is_homed

    def hear_buttons(self, joy: Joy) -> None:
        """Take the clutch.

        Pressed and released inside one step it still frees the hand; a Joy without its button says nothing.
        """
        if joy.buttons.size > self._clutch:
            self._pressed[0] = joy.buttons[self._clutch] != 0
            if self._is_free:
                self._interrupted[0] = 1.0

    @property
    def _is_free(self) -> bool:
        return bool(self._pressed[0]) is not self._must_hold

    def step(self, hand: Vector, tip: Vector, gripper: float, h: float, *, heard: bool) -> None:
        """Decide on this step, of `h` seconds; `heard`: the hand's pose is fresh.

        The other arguments are those of `AlignmentGate.check`.
        """
        self.warnings = []
        before = self.phase
        if self._must_hold and not heard and not self._lost[0]:
            self._pressed[0] = 0.0  # nobody knows what the hand does now, until it is told again
        self._lost[0] = not heard
        self._phase[0] = self._decide(hand, tip, gripper, h, heard=heard)
        if self.phase is Phase.DISABLED and before is not Phase.DISABLED:
            reason = (
                f"its master has been silent for more than {self._max_age / 1e6:g} ms"
                if self.arm_is_ready
                else "it is not ENABLED and homed"
            )
            self.warnings.append(f"{self._arm} holds: {reason}")
        self.takes_over = self.phase is Phase.ENABLED and (
            before is not Phase.ENABLED or bool(self._interrupted[0])
        )
        self._interrupted[0] = 0.0

    def _decide(self, hand: Vector, tip: Vector, gripper: float, h: float, *, heard: bool) -> Phase:
        gate = self._gate
        if not (heard and self.arm_is_ready):
            if gate is not None:
                gate.reset()
            return Phase.DISABLED
        if gate is not None and self._interrupted[0]:
            gate.clutch()
        if self._is_free:
            return Phase.CLUTCHED
        if (
            gate is None
            or (self.phase is Phase.ENABLED and not self._interrupted[0])
            or gate.check(hand, tip, gripper, h)
        ):
            return Phase.ENABLED
        if complaint := gate.complaint():
            self.warnings.append(f"{self._arm} waits: {complaint}")
        return Phase.ALIGNING
