"""The weight that the real controller bears: the endoscope's.

All else of an arm is balanced by springs and weights (docs/decisions/0010).
"""

from __future__ import annotations

import numpy as np

from robots.dvrk import inertia
from robots.dvrk.dynamics import STANDARD_GRAVITY, Dynamics
from robots.dvrk.linkage import Linkage
from robots.dvrk.setup_joints import CartArm
from robots.serial_chain import SerialChain
from schemas.vectors import Vector

__all__ = ["KnownWeight"]


class KnownWeight:
    """What the joints of one arm have to bear of it."""

    def __init__(self, arm: CartArm, chain: SerialChain, base: Vector) -> None:
        """Take the arm, its kinematics, and the pose of its base frame in the world, shape (4, 4)."""
        self._gravity = base[:3, :3].T @ np.array([0.0, 0.0, -STANDARD_GRAVITY])
        self._nothing = np.zeros(len(chain.joints))
        self._dynamics = None
        if arm == "ECM":
            self._dynamics = Dynamics(chain, Linkage((), ()), {"roll": inertia.ecm()["roll"]}, self._nothing)

    def effort(self, q: Vector) -> Vector:
        """Return the efforts (N m, N), shape (n,), that bear it at joint positions `q`, shape (n,)."""
        return self._nothing if self._dynamics is None else self._dynamics.gravity(q, self._gravity)
