"""Which stitches a needle driver can make, with and without rolling the needle in hand.

A stitch is feasible if the needle can go all its path with every joint in range, the instrument outside the
tissue, and no joint faster than it may be at `DRIVE`; the arm stays in one branch of its inverse kinematics,
so that it never has to jump. Without rolling the needle keeps the roll with which it was grasped; with
rolling that may change on the way as fast as the roller turns. All ways over the lattice of rolls are
followed at once, point by point.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import pi, radians

import numpy as np
from numpy.typing import NDArray

from robots.dvrk import held_needle, psm, stitch
from robots.dvrk.end_effectors.contact_sphere import FINGER_HALF_WIDTH
from robots.dvrk.held_needle import Needle
from robots.dvrk.instruments import ROLLING, SHAFT_RADIUS, WRIST_RADIUS, Instrument, instrument
from robots.dvrk.stitch import Stitch
from robots.serial_chain import SerialChain
from schemas.vectors import Vector

__all__ = ["DRIVE", "Study", "study"]

DRIVE = radians(30.0)
"""How fast the needle is turned through the tissue, rad/s: a stitch of 105 degrees takes 3.5 s."""

_JUMP = radians(45.0)
"""Most that a joint may turn between two points of a path, which are at most 5 degrees of the needle apart:
beyond, what is in between is unknown.
"""

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Study:
    """Which of the stitches are feasible."""

    stitches: tuple[Stitch, ...]
    rolls: Vector
    """Lattice of rolls, shape (m,), rad."""
    constant: Mask
    """Feasible by stitch and roll, shape (n, m): with the needle grasped at this roll and kept there."""
    rolling: Mask
    """Feasible by stitch, shape (n,): with any first roll, and rolling on the way."""

    @cached_property
    def best(self) -> int:
        """Index of the one grasp that serves most stitches; of equal ones that nearest to the middle."""
        most = np.flatnonzero(self.constant.sum(axis=0) == self.constant.sum(axis=0).max())
        return int(most[np.abs(self.rolls[most]).argmin()])

    @property
    def without(self) -> Mask:
        """Whether the standard needle driver can make each stitch, shape (n,), with one grasp for all.

        It is the grasp that serves most stitches.
        """
        return self.constant[:, self.best]

    @property
    def regrasped(self) -> Mask:
        """Whether the standard needle driver can make each stitch, shape (n,), with a grasp chosen for it."""
        return _any_true(self.constant, 1)

    def shares(self, of: Mask | None = None) -> dict[str, float]:
        """Return the shares of feasible stitches, of all or of those in the mask `of`, shape (n,)."""
        chosen = np.ones(len(self.stitches), bool) if of is None else of
        masks = {
            "feasible_share": self.rolling,
            "feasible_share_without": self.without,
            "feasible_share_regrasped": self.regrasped,
        }
        return {name: float(mask[chosen].mean()) for name, mask in masks.items()}

    def shares_by(self, what: str) -> dict[float, dict[str, float]]:
        """Return `shares` by the values of a field of `Stitch`: tilt, direction, entry or hold."""
        values = np.array([getattr(one, what) for one in self.stitches])
        return {float(value): self.shares(values == value) for value in np.unique(values)}


def study(stitches: tuple[Stitch, ...] | None = None, needle: Needle | None = None) -> Study:
    """Return the study of these stitches, or of `stitch.lattice()`, with `needle`."""
    stitches, needle, tool = (
        stitch.lattice() if stitches is None else stitches,
        needle or Needle(),
        instrument(ROLLING),
    )
    rolls = held_needle.rolls(held_needle.chain(tool, needle, 0.0))
    constant, rolling = np.zeros((len(stitches), len(rolls)), bool), np.zeros(len(stitches), bool)
    alike: dict[tuple[float, float, float], list[int]] = {}
    for i, one in enumerate(stitches):
        alike.setdefault((one.tilt, one.entry, one.hold), []).append(i)
    for some in alike.values():
        constant[some], rolling[some] = _feasible(tool, needle, [stitches[i] for i in some], rolls)
    return Study(stitches, rolls, constant, rolling)


def _feasible(tool: Instrument, needle: Needle, alike: Sequence[Stitch], rolls: Vector) -> tuple[Mask, Mask]:
    """Return which of k stitches of one tilt, entry and hold are feasible.

    First by roll without rolling, shape (k, m); then with rolling, shape (k,).
    """
    one = alike[0]
    paths = np.stack([stitch.path(each, needle) for each in alike])  # (k, points, 4, 4)
    seven = held_needle.chain(tool, needle, one.hold * needle.arc)
    q = held_needle.solutions(tool, seven, paths, rolls)  # (4, k, points, m, 6)
    allowed = _find_allowed(tool, q, stitch.tissue(one.tilt))
    # worth following: somehow possible at each point
    whole = np.flatnonzero(_any_true(allowed, (0, 3)).sum(axis=1) == paths.shape[1])
    branches = np.flatnonzero(_any_true(allowed, (1, 2, 3)))
    states, valid = _roll_by_a_turn(tool, q[branches][:, whole], allowed[branches][:, whole])
    seconds = (2.0 * one.entry + stitch.EMERGE) / (paths.shape[1] - 1) / DRIVE
    reach, turns = _reach(seven, seconds), int(seven.velocity[-1] * seconds / (rolls[1] - rolls[0]) + 1e-9)
    constant, rolling = np.zeros((len(alike), len(rolls)), bool), np.zeros(len(alike), bool)
    constant[whole], rolling[whole] = (
        _ways(states, valid, reach, 0),
        _any_true(_ways(states, valid, reach, turns), 1),
    )
    return constant, rolling


def _any_true(mask: Mask, axis: int | tuple[int, ...]) -> Mask:
    found: Mask = np.any(mask, axis=axis)
    return found


def _reach(seven: SerialChain, seconds: float) -> Vector:
    """Return how far the arm's joints may go from point to point, shape (6,)."""
    reach = seven.velocity[:-1] * seconds
    revolute = [joint.kind == "revolute" for joint in seven.joints[:-1]]
    return np.where(revolute, np.minimum(reach, _JUMP), reach)


def _find_allowed(tool: Instrument, q: Vector, surface: Vector) -> Mask:
    """Say, shape (...), which `q`, shape (..., 6), are allowed.

    All joints but the shaft's roll are in range and the instrument is outside the tissue.

    Jaw, wrist yaw and wrist pitch are each a ball as thick as they are.
    """
    arm = psm.chain(tool)
    allowed: Mask = np.all(((arm.lower <= q) & (q <= arm.upper))[..., [0, 1, 2, 4, 5]], axis=-1)
    frames = arm.frames(q[allowed])
    jaw = 0.0 if tool.jaw is None else tool.jaw.length - FINGER_HALF_WIDTH
    yaw, pitch, end = (
        frames[:, 5, :3, 3],
        frames[:, 4, :3, 3],
        frames[:, 6, :3, 3] + jaw * frames[:, 6, :3, 2],
    )
    balls = ((yaw, WRIST_RADIUS), (pitch, SHAFT_RADIUS), (end, FINGER_HALF_WIDTH))
    allowed[allowed] = np.all(
        [(centre - surface[:3, 3]) @ surface[:3, 2] >= radius for centre, radius in balls], axis=0
    )
    return allowed


def _roll_by_a_turn(tool: Instrument, q: Vector, allowed: Mask) -> tuple[Vector, Mask]:
    """Return positions with the shaft's roll also a turn less and a turn more, shape (3, ..., 6).

    The second value states which of them are allowed, shape (3, ...).
    """
    roll = psm.chain(tool).joints[3]
    wound = np.stack([q] * 3)
    wound[..., 3] += np.array([-2.0 * pi, 0.0, 2.0 * pi]).reshape(3, *[1] * (q.ndim - 1))
    return wound, (roll.lower <= wound[..., 3]) & (wound[..., 3] <= roll.upper) & allowed


def _ways(q: Vector, valid: Mask, reach: Vector, turns: int) -> Mask:
    """Return by stitch and roll at the end, shape (k, m), whether a path leads there.

    From point to point it rolls by at most `turns` of the lattice.

    Args:
        q: arm joints, shape (windings, branches, k, points, m, 6).
        valid: which of them may be, shape (windings, branches, k, points, m).
        reach: of each joint from point to point, shape (6,).
        turns: 0 for a needle that does not roll.
    """
    m = q.shape[-2]
    alive = valid[..., 0, :]
    for i in range(1, q.shape[-3]):
        after = np.zeros_like(alive)
        for shift in range(-turns, turns + 1):
            new, old = slice(max(shift, 0), m + min(shift, 0)), slice(max(-shift, 0), m + min(-shift, 0))
            for winding in range(-1, 2):  # the shaft's roll passes half a turn: its other name goes on
                to = slice(max(winding, 0), 3 + min(winding, 0))
                of = slice(max(-winding, 0), 3 + min(-winding, 0))
                near = (np.abs(q[to, :, :, i, new] - q[of, :, :, i - 1, old]) <= reach).all(axis=-1)
                after[to, ..., new] |= near & alive[of, ..., old]
        alive = after & valid[..., i, :]
    return _any_true(alive, (0, 1))
