"""Whether an arm can hold a needle along a way, and how far the joints stay from their ends. SI units."""

from __future__ import annotations

from math import degrees, pi

import numpy as np

from robots.dvrk.inverse import branches
from robots.serial_chain import SerialChain
from robots.transform import inverse_transform
from schemas.vectors import Vector

__all__ = ["MARGIN", "ArmReach", "best_reach", "joint_room"]

MARGIN = 0.05
"""Least share of half a joint's range left by a way, 4 degrees of a wrist.

Measured on drives of `suturing`: wrists follow their setpoints within 0.4 degrees, and a needle turning in
the jaw moves a wrist by 2 degrees more than planned.
"""
_TURNS = (-2.0 * pi, 0.0, 2.0 * pi)
"""Turns by which the shaft's roll may begin on or back, rad."""
_JUMP = 0.7
"""Largest turn of a joint between two poses of a way, rad: beyond, the arm would change its branch."""


class ArmReach:
    """The best branch of an arm along a way."""

    def __init__(self, chain: SerialChain, q: Vector) -> None:
        """Choose the margin of joint positions of shape (poses, 6)."""
        self._chain, self._q = chain, q
        self._free = _free(chain, q)
        turns = np.abs(np.diff(q, axis=0))
        self._jump = float(np.delete(turns, chain.prismatic, axis=1).max(initial=0.0))
        self.margin = float(self._free.min()) if self._jump <= _JUMP else -1.0 - self._jump
        """Least share of half a joint's range left; below `MARGIN` the way is not feasible."""

    @property
    def failure_reason(self) -> str:
        """Why the way is not feasible, with the number that fails; empty: feasible."""
        if self.margin >= MARGIN:
            return ""
        if self._jump > _JUMP:
            return f"a joint would have to jump by {degrees(self._jump):.0f} degrees"
        pose, joint = np.unravel_index(int(self._free.argmin()), self._free.shape)
        there, chain = self._chain.joints[int(joint)], self._chain
        value, low, high = (
            float(each) for each in (self._q[pose, joint], chain.lower[joint], chain.upper[joint])
        )
        kept = 0.5 * MARGIN * (high - low)
        low, high = low + kept, high - kept
        if there.kind == "prismatic":
            return f"{there.name} would be {value * 1e3:.1f} mm, allowed {low * 1e3:.0f} to {high * 1e3:.0f}"
        return (
            f"{there.name} would be {degrees(value):.1f} degrees, allowed {degrees(low):.0f} to"
            f" {degrees(high):.0f}"
        )


def joint_room(chain: SerialChain, base: Vector, tips: Vector) -> Vector:
    """Return the free share of half a joint's range at each of `tips`, shape (n, 4, 4), as (n,), alone.

    `base`: pose of the arm's base in the world, shape (4, 4). Below 0 a pose is out of reach.
    """
    found = np.stack(
        [_wind_roll(q, turn) for q in _both_branches(chain, base, tips) for turn in _TURNS]
    )  # (6, n, joints)
    most: Vector = _free(chain, found).min(axis=-1).max(axis=0)
    return most


def best_reach(chain: SerialChain, base: Vector, tips: Vector, roll: float | None = None) -> ArmReach:
    """Return the best of all joint paths along `tips`, shape (poses, 4, 4), in the world.

    `base`: pose of the arm's base in the world, shape (4, 4). The shaft's roll begins nearest to `roll`
    (rad); without, the roll may begin a turn on or back.
    """
    found = list[ArmReach]()
    turning = [joint.kind == "revolute" for joint in chain.joints]
    for q in _both_branches(chain, base, tips):
        q[:, turning] = np.unwrap(q[:, turning], axis=0)
        turns = _TURNS if roll is None else (2.0 * pi * round((roll - q[0, 3]) / (2.0 * pi)),)
        found += [ArmReach(chain, _wind_roll(q, turn)) for turn in turns]
    return max(found, key=lambda each: each.margin)


def _free(chain: SerialChain, q: Vector) -> Vector:
    """Return the share of half of each joint's range left, of the shape of `q`, (..., joints)."""
    free: Vector = 2.0 * np.minimum(q - chain.lower, chain.upper - q) / (chain.upper - chain.lower)
    return free


def _both_branches(chain: SerialChain, base: Vector, tips: Vector) -> Vector:
    """Return the joint positions of both branches of an arm, shape (2, poses, 6)."""
    return branches(chain, inverse_transform(base) @ tips)[:2]


def _wind_roll(q: Vector, turn: float) -> Vector:
    """Return joint positions, shape (poses, 6), with the shaft's roll a turn (rad) on."""
    wound = q.copy()
    wound[:, 3] += turn
    return wound
