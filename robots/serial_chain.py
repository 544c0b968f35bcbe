"""Kinematics of a serial chain in modified Denavit-Hartenberg form.

Link i is at Rx(alpha) Tx(a) Rz(theta) Tz(d) in link i-1 (Craig, Introduction to Robotics, section 3.4); q is
added to theta of a revolute and to d of a prismatic joint. `from_standard` converts a table in standard form.

A chain takes a configuration, shape (n,), or many at once, shape (..., n).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, inf, sin
from typing import Any, Literal

import numpy as np

from robots.limits import ANGLE_TOLERANCE, TOLERANCE, distinct
from schemas.errors import MotionError
from schemas.vectors import Vector

try:
    from robots import _kinematics as compiled
except ImportError:  # there was no compiler, or numpy's inner loops are not where they were
    compiled = None

__all__ = ["Joint", "SerialChain", "check", "compiled", "jerk_limit"]

_YZX, _ZXY = np.array([1, 2, 0]), np.array([2, 0, 1])
"""Index orders for the two products of each element of a cross product."""
_RISE = 0.1
"""Time of a trajectory's acceleration to grow from 0 to its limit, s.

The dVRK's own trajectories (Reflexxes, type II) do not limit jerk; for the choice see docs/decisions/0007.
"""


def jerk_limit(acceleration: float) -> float:
    """Return the jerk limit (rad/s^3, m/s^3) for a limit of the acceleration (rad/s^2, m/s^2)."""
    return acceleration / _RISE


@dataclass(frozen=True)
class Joint:
    """A joint: modified DH row and limits, in rad or m, s, N m or N.

    Units of the limits: range rad, m; velocity rad/s, m/s; effort N m, N; acceleration rad/s^2, m/s^2; jerk
    rad/s^3, m/s^3.
    """

    name: str
    kind: Literal["revolute", "prismatic"]
    alpha: float
    a: float
    d: float
    theta: float
    lower: float
    upper: float
    velocity: float = inf
    effort: float = inf
    acceleration: float = inf
    jerk: float = inf

    @property
    def unit(self) -> str:
        """Of a position: rad or m."""
        return "rad" if self.kind == "revolute" else "m"

    def refusal(self, position: float) -> str:
        """Return the sentence of refusal of a position out of range, in rad or m."""
        value, lower, upper = distinct(position, self.lower, self.upper)
        return f"joint {self.name} at {value} {self.unit}, allowed are {lower} .. {upper}"

    def transform(self, q: float) -> Vector:
        """Return the pose of this link in the previous link, shape (4, 4), at joint position `q`."""
        theta, d = (self.theta + q, self.d) if self.kind == "revolute" else (self.theta, self.d + q)
        ca, sa, ct, st = _cos(self.alpha), _sin(self.alpha), _cos(theta), _sin(theta)
        return np.array(
            [
                [ct, -st, 0.0, self.a],
                [st * ca, ct * ca, -sa, -d * sa],
                [st * sa, ct * sa, ca, d * ca],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )


def _cos(angle: float) -> float:
    return cos(angle) if abs(cos(angle)) > 1e-15 else 0.0  # so that right angles are exact


def _sin(angle: float) -> float:
    return sin(angle) if abs(sin(angle)) > 1e-15 else 0.0


class SerialChain:
    """Forward kinematics and geometric Jacobian of n joints and a tip fixed to the last link."""

    def __init__(self, joints: Sequence[Joint], tip: Vector, base: Vector | None = None) -> None:
        """Build the chain.

        Args:
            joints: the n joints, from the base outwards.
            tip: pose of the tip in the last link's frame, shape (4, 4).
            base: pose of the frame before the first joint in the base frame, shape (4, 4); None: identity.
        """
        self.joints = tuple(joints)
        self.tip = tip
        self.lower = np.array([joint.lower for joint in joints])  # (n,)
        self.upper = np.array([joint.upper for joint in joints])  # (n,)
        self._ranges = [(joint.lower, joint.upper) for joint in joints]
        self.names = [joint.name for joint in joints]
        self.velocity = np.array([joint.velocity for joint in joints])  # (n,)
        self.acceleration = np.array([joint.acceleration for joint in joints])  # (n,)
        self.jerk = np.array([joint.jerk for joint in joints])  # (n,)
        self.effort = np.array([joint.effort for joint in joints])  # (n,)
        self.tolerance = np.array(
            [ANGLE_TOLERANCE if joint.kind == "revolute" else TOLERANCE for joint in joints]
        )  # (n,), by which a position may be outside its range and is clamped
        self.prismatic = [i for i, joint in enumerate(joints) if joint.kind == "prismatic"]
        """Their indices."""
        # A link's transform is affine in (cos q, sin q) or in q: all of them come from one multiplication.
        zero = np.array([joint.transform(0.0) for joint in joints])
        quarter = np.array(
            [joint.transform(np.pi / 2 if joint.kind == "revolute" else 1.0) for joint in joints]
        )
        half = np.array([joint.transform(np.pi) for joint in joints])
        revolute = np.array([joint.kind == "revolute" for joint in joints])[:, None, None]
        constant = np.where(revolute, (zero + half) / 2, zero)
        cosine = np.where(revolute, (zero - half) / 2, 0.0)
        other = quarter - constant  # factor of sin q, or of q
        basis = np.stack([constant, cosine, other], axis=1)  # (n, 3, 4, 4)
        if base is not None:
            basis[0] = base @ basis[0]
        self.basis = basis.reshape(len(self.joints), 3, 16)
        """Basis of the links' transforms, for the factors 1, cos q or 0, and sin q or q."""
        slides = np.array([joint.kind == "prismatic" for joint in joints], np.float64)
        self.numbers = self.basis, np.ascontiguousarray(tip), self.lower, self.upper, slides
        """Arguments of the compiled functions."""
        self._free: list[_Workspace] = []
        """Workspaces of `frames`, not in use by any thread."""
        # Where the factors of the Jacobian's cross products are in the numbers of `frames`, (2, 3, n) each.
        at = np.arange(0, 16 * len(self.joints), 16) + np.arange(0, 12, 4)[:, None]  # (3, n): first column
        self._axes = at + 2
        self._crossed_axes = np.stack([at[_YZX], at[_ZXY]]) + 2
        self._crossed_origins = np.stack([at[_ZXY], at[_YZX]]) + 3
        self._crossed_tips = self._crossed_origins % 16 + 16 * len(self.joints)

    @classmethod
    def from_standard(cls, joints: Sequence[Joint], tip: Vector) -> SerialChain:
        """Return the chain of joints with DH rows of standard form.

        In standard form, link i is at Rz(theta) Tz(d) Tx(a) Rx(alpha) in link i-1.

        Only the frames between base and tip differ from the standard form: the a and alpha of a row move to
        the next row, of the last row to the tip.
        """
        last = Joint("", "revolute", joints[-1].alpha, joints[-1].a, 0.0, 0.0, 0.0, 0.0).transform(0.0)
        before = [(0.0, 0.0), *((joint.alpha, joint.a) for joint in joints[:-1])]
        return cls(
            [replace(joint, alpha=alpha, a=a) for joint, (alpha, a) in zip(joints, before, strict=True)],
            last @ tip,
        )

    def frames(self, q: Vector) -> Vector:
        """Return the poses of all links and of the tip in the base frame, shape (..., n + 1, 4, 4).

        Positions `q` have shape (..., n).

        Raises MotionError for another number of joints.
        """
        n = len(self.joints)
        if q.shape[-1:] != (n,):
            self.check_form(q)
        if q.ndim > 1:
            return _frames(q, self.basis, self.tip, self.prismatic)
        if compiled is not None and (found := compiled.frames(self.numbers, q)) is not None:
            return found
        try:
            workspace = self._free.pop()
        except IndexError:  # the first call, or another thread is in the midst of one
            workspace = _Workspace(self.basis, self.tip, self.prismatic)
        poses = workspace.frames(q)
        self._free.append(workspace)
        return poses

    def __getstate__(self) -> dict[str, Any]:
        """Return the state of a copy, without workspaces: their arrays share memory."""
        return self.__dict__ | {"_free": []}

    def out_of_range(self, q: Vector) -> list[str]:
        """Return a sentence for each joint of `q`, shape (n,), out of range by more than `tolerance`."""
        return [
            joint.refusal(value)
            for joint, value, slack in zip(self.joints, q.tolist(), self.tolerance.tolist(), strict=True)
            if not joint.lower - slack <= value <= joint.upper + slack
        ]

    def check_form(self, q: Vector) -> None:
        """Raise MotionError if `q`, shape (..., n), is not n finite numbers for every configuration."""
        if q.shape[-1:] != self.lower.shape:
            names = ", ".join(self.names)
            raise MotionError(f"positions of shape {q.shape}, expected {len(self.joints)}: {names}")
        if 0 in (finite := np.isfinite(q)).tobytes():  # a third of the cost of finite.all()
            wrong = q[~finite.all(axis=-1)][0] if q.ndim > 1 else q
            raise MotionError(f"not all positions are finite: {wrong.tolist()} of {', '.join(self.names)}")

    def check(self, q: Vector) -> None:
        """Raise MotionError if `q` is not n finite numbers within the joint ranges and `tolerance`."""
        self.check_form(q)
        if q.ndim > 1:
            raise MotionError(
                f"positions of shape {q.shape}, expected those of one configuration, ({len(self.joints)},)"
            )
        if wrong := self.out_of_range(q):
            raise MotionError("; ".join(wrong))

    def within(self, q: Vector) -> Vector:
        """Return `q`, shape (n,), clamped to the joint ranges: itself where all are inside.

        Raises MotionError as `check` does.
        """
        if q.shape == self.lower.shape and self.contains(q):
            return q
        self.check(q)
        return np.clip(q, self.lower, self.upper)

    def contains(self, q: Vector) -> bool:
        """Return whether each position of `q`, shape (n,), is strictly inside the joint's range."""
        for value, (lower, upper) in zip(q.tolist(), self._ranges, strict=True):
            if not lower < value < upper:
                return False
        return True

    def forward(self, q: Vector) -> Vector:
        """Return the pose of the tip in the base frame, shape (..., 4, 4), at `q`, shape (..., n).

        Positions may be outside the joint ranges.

        Raises MotionError for another number of joints, or a position not finite.
        """
        self.check_form(q)
        return self.frames(q)[..., -1, :, :]

    def jacobian(self, frames: Vector, *, frame: Literal["base", "tip"] = "base") -> Vector:
        """Return J, shape (..., 6, n), with twist of the tip (m/s, rad/s) = J dq, from `frames(q)`.

        Args:
            frames: result of `frames(q)`.
            frame: axes of the twist; the point is the tip's origin either way. The Jacobian in the tip's
                frame is the dVRK's `body/jacobian`. The dVRK's `spatial/jacobian` has the point at the base
                frame's origin (jhu-cisst/cisst, cisstRobot/code/robManipulator.cpp, JacobianSpatial).
        """
        if frames.ndim == 3 and frame == "base":
            return self._jacobian_of_one(frames)
        axes = frames[..., :-1, :3, 2]  # (..., n, 3)
        arms = frames[..., -1:, :3, 3] - frames[..., :-1, :3, 3]  # (..., n, 3)
        across = axes.take(_YZX, -1) * arms.take(_ZXY, -1) - axes.take(_ZXY, -1) * arms.take(_YZX, -1)
        jacobian = np.empty((*frames.shape[:-3], 6, len(self.joints)))
        jacobian[..., :3, :] = across.swapaxes(-1, -2)
        jacobian[..., 3:, :] = axes.swapaxes(-1, -2)
        for joint in self.prismatic:
            jacobian[..., :3, joint] = axes[..., joint, :]
            jacobian[..., 3:, joint] = 0.0
        if frame == "tip":
            to_tip = frames[..., -1, :3, :3].swapaxes(-1, -2)
            jacobian[..., :3, :] = to_tip @ jacobian[..., :3, :]
            jacobian[..., 3:, :] = to_tip @ jacobian[..., 3:, :]
        return jacobian

    def _jacobian_of_one(self, frames: Vector) -> Vector:
        """Return the same, shape (6, n), from frames of shape (n + 1, 4, 4): for few numbers, few calls."""
        numbers = frames.reshape(-1)
        arms = numbers.take(self._crossed_tips) - numbers.take(self._crossed_origins)
        one, other = numbers.take(self._crossed_axes) * arms
        jacobian = np.empty((6, len(self.joints)))
        np.subtract(one, other, out=jacobian[:3])
        jacobian[3:] = numbers.take(self._axes)
        for joint in self.prismatic:
            jacobian[:3, joint] = jacobian[3:, joint]
            jacobian[3:, joint] = 0.0
        return jacobian


class _Workspace:
    """Arrays for the frames of one configuration, with all views made beforehand.

    The products equal the products of `_frames` to the bit: `dot` calls the same function of BLAS as
    `matmul`, at a third of the cost.
    """

    def __init__(self, basis: Vector, tip: Vector, prismatic: Sequence[int]) -> None:
        """`basis`: `SerialChain.basis`, shape (n, 3, 16); `tip`: shape (4, 4); `prismatic`: joint indices."""
        n = len(basis)
        self._basis, self._prismatic = basis, prismatic
        self._factors, self._links = np.ones((n, 1, 3)), np.empty((n, 1, 16))
        self._poses = np.empty((n + 1, 4, 4))
        self._cosines, self._others = self._factors[:, 0, 1], self._factors[:, 0, 2]
        self._first = self._poses[0], self._links[0].reshape(4, 4)
        links = [*self._links.reshape(n, 4, 4)[1:], tip]
        self._products = [
            (before.dot, link, after)
            for before, link, after in zip(self._poses[:-1], links, self._poses[1:], strict=True)
        ]

    def frames(self, q: Vector) -> Vector:
        """Return the poses of all links and of the tip, shape (n + 1, 4, 4), at `q`, shape (n,)."""
        np.cos(q, out=self._cosines)
        np.sin(q, out=self._others)
        for joint in self._prismatic:
            self._others[joint] = q[joint]
        np.matmul(self._factors, self._basis, out=self._links)
        first, link = self._first
        first[:] = link
        for before, link, after in self._products:
            before(link, after)
        return self._poses.copy()


def check() -> tuple[bool, str, str]:
    """Return whether kinematics are compiled here, the consequence, and the remedy, for `trocar doctor`."""
    works = compiled is not None
    detail = "compiled" if works else "in Python: the same results, several times slower"
    return works, detail, "install a C compiler, then install Trocar again"


def _frames(q: Vector, basis: Vector, tip: Vector, prismatic: Sequence[int]) -> Vector:
    """Return the poses of links and tips, shape (..., n + 1, 4, 4), at positions `q`, shape (..., n).

    `basis`: basis of one chain or of several, shape (..., n, 3, 16); `tip`: shape (..., 4, 4).
    """
    n = q.shape[-1]
    factors = np.ones((*q.shape, 1, 3))
    np.cos(q, out=factors[..., 0, 1])
    np.sin(q, out=factors[..., 0, 2])
    for joint in prismatic:
        factors[..., joint, 0, 2] = q[..., joint]
    links = (factors @ basis).reshape(*q.shape, 4, 4)
    poses = np.empty((*q.shape[:-1], n + 1, 4, 4))
    poses[..., 0, :, :] = links[..., 0, :, :]
    for i in range(1, n):
        np.matmul(poses[..., i - 1, :, :], links[..., i, :, :], out=poses[..., i, :, :])
    np.matmul(poses[..., n - 1, :, :], tip, out=poses[..., n, :, :])
    return poses
