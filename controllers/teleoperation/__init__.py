"""Teleoperation: a hand leads an instrument on a patient-side manipulator, and feels contact."""

from controllers.teleoperation.controller import Teleoperation
from controllers.teleoperation.params import TeleoperationParams

__all__ = ["Teleoperation", "TeleoperationParams"]
