"""Forward kinematics for `trocar model fk`: the pose of an arm's tip.

The command itself is mounted beside the other commands of `trocar model`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypedDict

import numpy as np

from robots.dvrk.arms import base_frame, chain
from schemas.errors import MotionError

__all__ = ["TipPose", "fk", "table"]


class TipPose(TypedDict):
    """Pose of an arm's tip in the frame `frame`, as in the real system's `local/measured_cp`."""

    arm: str
    frame: str
    joints: list[str]
    q: list[float]
    """Joint positions, rad and m."""
    p: list[float]
    """Position, m."""
    R: list[list[float]]
    """Rotation matrix, by rows."""


def fk(arm: str, tool: str | None, q: Sequence[float]) -> TipPose:
    """Return the pose of the tip of `arm` at joint positions `q` (rad, m).

    Args:
        arm: a name of `robots.dvrk.arms.ARMS`.
        tool: instrument of a PSM, by name or number, or endoscope of the ECM; None: the default tool.
        q: a number per joint; the setup joint of the ECM also takes the four moving joints.

    Raises:
        MotionError: unknown arm or tool, wrong number of joints, or a joint out of range.
    """
    kinematics = chain(arm, tool)
    positions = [*q, 0.0, 0.0] if arm == "SUJ/ECM" and len(q) == 4 else list(q)
    names = [joint.name for joint in kinematics.joints]
    if len(positions) != len(names):
        raise MotionError(f"{arm}: {len(q)} joint positions, expected {len(names)}: {', '.join(names)}")
    kinematics.check(np.array(positions, np.float64))
    tip = kinematics.forward(np.array(positions, np.float64)) + 0.0  # no negative zeros
    return TipPose(
        arm=arm,
        frame=base_frame(arm),
        joints=names,
        q=positions,
        p=tip[:3, 3].tolist(),
        R=tip[:3, :3].tolist(),
    )


def table(pose: TipPose) -> str:
    """Return the pose as lines for a person: joints, position and rotation matrix."""
    joints = ", ".join(f"{name} {value:g}" for name, value in zip(pose["joints"], pose["q"], strict=True))
    rows = (f"R row {i}  " + "  ".join(f"{cell: .9f}" for cell in row) for i, row in enumerate(pose["R"]))
    return "\n".join(
        [
            f"{pose['arm']} at {joints} (rad, m)",
            f"tip in frame {pose['frame']}",
            "p (m)    " + "  ".join(f"{x: .9f}" for x in pose["p"]),
            *rows,
        ]
    )
