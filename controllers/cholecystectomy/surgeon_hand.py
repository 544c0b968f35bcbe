"""A robot hand that knows its joints."""

from __future__ import annotations

import numpy as np

from controllers.expert.hand import RobotHand
from robots.dvrk.instruments import Jaw
from robots.serial_chain import SerialChain
from schemas.vectors import Vector

__all__ = ["SurgeonHand"]


class SurgeonHand(RobotHand):
    """An arm's line and jaw, with the measured joints."""

    def __init__(self, arm: str, base: Vector, chain: SerialChain, jaw: Jaw) -> None:
        super().__init__(arm, base, chain, jaw)
        self.joints: Vector = np.zeros(len(chain.joints))
        """Measured joint positions, rad and m, shape (6,)."""
