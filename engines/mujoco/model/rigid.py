"""Stiff constraints: ties between joints, stops, and welds."""

from __future__ import annotations

import mujoco

__all__ = ["RIGID", "tie"]

RIGID = {"solref": [1e-3, 1.0], "solimp": [0.999, 0.9999, 1e-4, 0.5, 2.0]}
"""A time constant of twice the default sub-step, the shortest allowed by MuJoCo, and all but rigid."""


def tie(spec: mujoco.MjSpec, name: str, follower: str, leader: str, ratio: float = 1.0) -> None:
    """Hold the joint `follower` at `ratio` times the position of the joint `leader`."""
    spec.add_equality(
        name=name,
        type=mujoco.mjtEq.mjEQ_JOINT,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        name1=follower,
        name2=leader,
        data=[0.0, ratio, *[0.0] * 10],
        **RIGID,
    )
