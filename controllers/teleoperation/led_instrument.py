"""The parts of a teleoperation that belong to one of the instruments that the led arm may hold."""

from __future__ import annotations

from controllers.clip_trigger import ClipTrigger
from controllers.teleoperation.jaw import JawGhost
from controllers.teleoperation.params import TeleoperationParams
from controllers.teleoperation.pose_law import PoseLaw
from robots.inverse_kinematics import LastFrames

__all__ = ["LedInstrument"]


class LedInstrument:
    """Kinematics, law, jaw and clip trigger with an instrument."""

    def __init__(self, params: TeleoperationParams) -> None:
        self.chain = params.chain
        self.frames = LastFrames(self.chain)
        self.law = (
            PoseLaw(self.chain, turns=params.orientation == "follow", frames=self.frames)
            if params.law == "pose"
            else None
        )
        self.ghost = None if params.tool.jaw is None else JawGhost(params.tool.jaw)
        self.trigger = None if params.tool.clip is None else ClipTrigger()
        parts = (self.law, self.ghost, self.trigger)
        self.state = tuple(part.state for part in parts if part is not None)
        """Records to keep."""
