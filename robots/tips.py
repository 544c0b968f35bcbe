"""Poses, twists and Jacobians of the tips of several arms at once, as commanded and as measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robots import serial_chain
from robots.rotation import from_matrices
from robots.serial_chain import SerialChain
from schemas.vectors import Vector

__all__ = ["Tips", "tip_poses"]


class Tips:
    """The tips of k arms with n joints of the same kinds, in their base frames."""

    def __init__(self, chains: Sequence[SerialChain], state: Vector, poses: Vector, twists: Vector) -> None:
        """Keep the arrays read and written by `update`.

        Args:
            chains: kinematics of the arms.
            state: positions, velocities and efforts as commanded, then as measured, shape (k, 2, 3, n).
            poses: written: poses of the tips, shape (k, 2, 4, 4).
            twists: written: their twists, shape (k, 2, 6).
        """
        self.chains = list(chains)
        self._state, self._poses, self._twists = state, poses, twists
        self.jacobian = np.zeros((len(state), 6, state.shape[-1]))
        """Jacobians of the measured positions, shape (k, 6, n)."""
        self._arms = list(zip(state, poses, twists, self.jacobian, strict=True))

    def update(self) -> None:
        """Write poses, twists and Jacobians."""
        compiled = serial_chain.compiled
        for chain, (state, poses, twists, jacobian) in zip(self.chains, self._arms, strict=True):
            if compiled is None or not compiled.tips(chain.numbers, state, poses, twists, jacobian):
                frames = chain.frames(state[:, 0])  # (2, n + 1, 4, 4)
                both = chain.jacobian(frames)  # (2, 6, n)
                poses[:], jacobian[:] = frames[:, -1], both[1]
                twists[:] = (both @ state[:, 1, :, None])[..., 0]


def tip_poses(base: Vector, tips: Vector, poses: Vector) -> None:
    """Write positions and quaternions of bases and tips, shape (k, 5, 7).

    In this order: base; tip as commanded in the base frame, and in the frame around the base; the same of the
    tip as measured.

    Args:
        base: poses of the base frames, shape (k, 4, 4).
        tips: poses of the tips in their base frames, as commanded and as measured, shape (k, 2, 4, 4).
        poses: written.
    """
    compiled = serial_chain.compiled
    if compiled is not None and compiled.tip_poses(base, tips, poses):
        return
    frames = np.empty((len(base), 5, 4, 4))
    frames[:, 0], frames[:, 1::2] = base, tips
    np.matmul(base[:, None], tips, out=frames[:, 2::2])
    poses[..., :3] = frames[..., :3, 3]
    poses[..., 3:] = from_matrices(frames.reshape(-1, 4, 4)).reshape(-1, 5, 4)
