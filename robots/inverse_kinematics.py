"""Inverse kinematics of a serial chain by damped least squares on the pose error.

Levenberg-Marquardt after Sugihara, "Solvability-Unconcerned Inverse Kinematics by the Levenberg-Marquardt
Method", IEEE Transactions on Robotics 27(5), 2011: the damping falls with the squared error, so a reachable
goal is met quadratically and an unreachable goal approached without chatter.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robots import rotation
from robots.serial_chain import SerialChain, compiled
from schemas.vectors import Vector

__all__ = ["LastFrames", "pursue"]

_LENGTH = 0.1
"""Weight of orientation against position: 1 rad counts as 0.1 m, about the tip's distance from the RCM."""
_LITTLE = 1e-4
"""Weight of orientation for an arm of fewer than six joints: position first, with an error of nanometres."""
_LEAST_DAMPING = 1e-12
"""Least damping of the normal equations, m^2: below the singular values of the weighted Jacobian for a joint
motion of the tip by a micrometre.
"""
_MET = 1e-15
"""Weighted error of a goal considered met, m: some ten times the rounding error of the forward kinematics."""
_CORRECTIONS = 4
"""Most corrections per call; each squares the error, and two suffice at the usual speeds."""


class LastFrames:
    """Frames of a chain, cached for the last positions.

    A control loop starts at the positions of the last step, and reads the tip there.
    """

    def __init__(self, chain: SerialChain) -> None:
        """`chain`: the kinematics."""
        self._chain, self._positions = chain, b""
        self._frames = np.empty(0)

    def __call__(self, q: Vector) -> Vector:
        """Return `SerialChain.frames(q)`, shape (n + 1, 4, 4), of `q`, shape (n,): only to be read."""
        if (positions := q.tobytes()) != self._positions:
            self._frames, self._positions = self._chain.frames(q), positions
        return self._frames


def pursue(
    chain: SerialChain,
    q: Vector,
    position: Vector,
    orientation: Vector,
    largest_move: Vector,
    frames_at: Callable[[Vector], Vector] | None = None,
) -> Vector:
    """Return joint positions, shape (n,), at the goal or nearer to the goal than `q`.

    The positions stay inside the joint ranges and `largest_move`.

    For each step of a control loop: a goal moving at the usual speeds is met to 1e-15 m, an unreachable goal
    followed with least weighted error. A met goal causes no motion, not even by rounding. An arm of fewer
    than six joints meets the position, with the orientation as near as possible.

    Args:
        chain: the kinematics.
        q: start, shape (n,), rad and m.
        position: goal of the tip in the base frame, m, shape (3,).
        orientation: goal of the tip in the base frame, quaternion (x, y, z, w).
        largest_move: largest move of each joint, shape (n,); all joints slow down together, so the path stays
            straight.
        frames_at: `chain.frames`, or `LastFrames` of it.
    """
    length = _LENGTH if len(q) >= 6 else _LITTLE
    if compiled is not None:
        reached = compiled.pursue(
            chain.numbers,
            q,
            position,
            orientation,
            largest_move,
            length,
            _LEAST_DAMPING,
            _MET**2,
            _CORRECTIONS,
        )
        if reached is not None:
            return reached
    found: Vector = q
    frames_at = frames_at or chain.frames
    for _ in range(_CORRECTIONS):
        frames = frames_at(found)
        error = _error(frames[-1], position, orientation, length)
        squared = float(error.dot(error))
        if squared < _MET**2:
            break
        move = found + _correction(chain, found, frames, error, squared, length) - q
        shares: list[float] = (move / largest_move).tolist()
        share = max(map(abs, shares))  # half of the cost of numpy's
        found = q + move / max(1.0, share)
        if share >= 1.0:
            break
    return found


def _error(tip: Vector, position: Vector, orientation: Vector, length: float) -> Vector:
    """Return the error from the pose `tip`, shape (4, 4), to the goal, shape (6,).

    The displacement comes first, then the rotation vector in metres.
    """
    (px, py, pz), (tx, ty, tz) = position.tolist(), tip[:3, 3].tolist()
    rx, ry, rz = rotation.turn_to(orientation, tip)
    return np.array([px - tx, py - ty, pz - tz, length * rx, length * ry, length * rz])


def _correction(
    chain: SerialChain, q: Vector, frames: Vector, error: Vector, squared: float, length: float
) -> Vector:
    """Return a move, shape (n,), inside the joint ranges; `squared`: squared error.

    A joint about to leave its range stops at the end of the range; the remaining joints correct further.
    """
    jacobian = chain.jacobian(frames)
    jacobian[3:] *= length
    transposed = jacobian.T
    normal: Vector = transposed.dot(jacobian)  # the same bits as `@`, at half of its cost
    normal.reshape(-1)[:: len(q) + 1] += 0.5 * squared + _LEAST_DAMPING
    gradient: Vector = transposed.dot(error)
    move = np.linalg.solve(normal, gradient)
    reached = q + move
    if chain.contains(reached):
        return reached - q
    least, most = chain.lower - q, chain.upper - q
    free = np.ones(len(q), dtype=bool)
    while (outside := free & ((move < least) | (move > most))).any():
        free &= ~outside
        move[outside] = np.where(move < least, least, most)[outside]
        move[free] = np.linalg.solve(
            normal[np.ix_(free, free)], gradient[free] - normal[np.ix_(free, ~free)] @ move[~free]
        )
    return np.minimum(np.maximum(q + move, chain.lower), chain.upper) - q
