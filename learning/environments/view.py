"""Observations of a session at an instant: tips, jaws, objects and tissue, in the world.

Metres and radians; quaternions (x, y, z, w).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, cast

import numpy as np

import trocar
from robots import rotation
from schemas.vectors import Vector
from tasks.instant import base_pose
from tasks.task import Task

__all__ = ["EnvironmentView"]

_TISSUE = {
    "tissue/held": "forceps/held",
    "tissue/lift": "forceps/lift",
    "tissue/loose": "strip/loose",
    "tissue/freed": "flap/areolar/freed",
    "tissue/dead": "flap/base/dead",
}
"""Ports of a scene's tissue by name in an observation."""


class _Hands(Protocol):
    """The scene's `actions`: arms with encoders."""

    @property
    def has_joint_errors(self) -> bool: ...

    def measured_tip(self, arm: str, q: Vector) -> Vector: ...


class EnvironmentView:
    """Reads the newest outputs of a session's robot, and of its tissue if present."""

    def __init__(self, session: trocar.SteppedSession, task: Task, arms: Sequence[str]) -> None:
        self._session, self.arms, self.things = session, tuple(arms), task.things
        self._bases = [base_pose(task.params, arm) for arm in task.params.psms if arm in arms]
        self._turns = [rotation.from_matrix(base) for base in self._bases]
        self._numbers = [float(arm[-1]) for arm in arms]
        tissue = session.plan.participants.get("tissue")
        outputs = {port.name for port in tissue.ports} if tissue else set[str]()
        self._tissue = {name: f"tissue.{port}" for name, port in _TISSUE.items() if port in outputs}
        ports = {port.name for port in session.plan.participants["actions"].ports}
        self._powers = {arm: f"actions.{arm}/energy" for arm in self.arms if f"{arm}/energy" in ports}
        """Outputs with the power of hands with an electrode."""
        m, n = len(self.arms), len(self.things)
        self.tips, self.jaws = np.zeros((m, 7)), np.zeros(m)
        """Poses of the tips, shape (m, 7), and openings of the jaws, rad, shape (m,); of an electrode 1 with
        power, else 0.
        """
        self._actions = cast("_Hands", session.participant("actions"))
        self.measured_tips = np.zeros((m, 7)) if self._actions.has_joint_errors else self.tips
        """Poses of the tips as measured: encoders with offsets do not tell the truth."""
        self.poses, self.held = np.zeros((n, 7)), np.zeros((n, m))
        """Poses of the things, shape (n, 7), and whether each hand holds each, shape (n, m)."""
        self.tissue = dict.fromkeys(self._tissue, 0.0)
        """Whether tissue is held, the lifted height of the held tissue, m, and the share that is cut off."""

    def read(self) -> None:
        """Read the present instant."""
        session = self._session
        for i, arm in enumerate(self.arms):
            tip, base = session.read(f"robot.{arm}/measured_cp"), self._bases[i]
            self.tips[i, :3] = base[:3, :3] @ tip["position"] + base[:3, 3]
            self.tips[i, 3:] = rotation.product(self._turns[i], tip["orientation"])
            if self.measured_tips is not self.tips:
                q = session[f"robot.{arm}/measured_js"]
                self.measured_tips[i] = self._actions.measured_tip(arm, q[: len(q) // 3])
            if arm in self._powers:
                self.jaws[i] = session[self._powers[arm]][0] > 0.0
            else:
                self.jaws[i] = session.read(f"robot.{arm}/jaw/measured_js")["position.jaw"]
        for i, thing in enumerate(self.things):
            self.poses[i] = session[f"robot.{thing}/pose"]
            holder = session[f"robot.{thing}/held_by"][0]
            self.held[i] = [holder == number for number in self._numbers]
        for name, port in self._tissue.items():
            self.tissue[name] = float(session[port][0])

    def names(self) -> dict[str, int]:
        """Return the parts of `vector` with their sizes, in order."""
        names: dict[str, int] = {}
        for arm in self.arms:
            last = "power" if arm in self._powers else "jaw"
            names |= {f"{arm}/tip/position": 3, f"{arm}/tip/orientation": 4, f"{arm}/{last}": 1}
        for thing in self.things:
            names |= {f"{thing}/position": 3, f"{thing}/orientation": 4}
            names |= {f"{thing}/held_by/{arm}": 1 for arm in self.arms}
        return names | dict.fromkeys(self._tissue, 1)

    def vector(self) -> Vector:
        """Return all values in a row, shape (size,), in the order of `names`."""
        hands = np.column_stack([self.measured_tips, self.jaws])
        things = np.column_stack([self.poses, self.held])
        return np.concatenate([hands.ravel(), things.ravel(), [*self.tissue.values()]])
