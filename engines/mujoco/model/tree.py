"""The links of an arm as a tree, each with its pose in `<arm>_base` while every joint is at 0.

The main chain has the frames of the arm's modified DH table, so that the tip is exact. The bars of the
linkage and the fingers hang on it; the axis of every joint is z of its own frame.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from engines.mujoco.model.names import FINGERS
from robots.dvrk.instruments import Instrument
from robots.dvrk.linkage import LINKAGES
from robots.dvrk.mounted import MountedEcm, MountedPsm
from robots.dvrk.rolling_needle_driver import PADS
from schemas.vectors import Vector

__all__ = ["BASE", "Follow", "Link", "links"]

BASE = "base"
"""The link that stands still; its frame has its origin in the remote centre of motion."""


@dataclass(frozen=True)
class Follow:
    """A passive joint's tie: its position is `ratio` times that of `joint`."""

    joint: str
    ratio: float


@dataclass(frozen=True)
class Link:
    """One link: the joint, along or about its z axis, that joins it to its parent."""

    name: str
    parent: str
    kind: Literal["revolute", "prismatic"]
    pose: Vector
    """In the base frame with every joint at 0, shape (4, 4)."""
    lower: float
    upper: float
    follow: Follow | None = None


def links(arm: str, params: MountedPsm | MountedEcm) -> tuple[Link, ...]:
    """Return all moving links of `arm`, parents before children.

    They are its joints, then the linkage, then the fingers of a jaw with the pads of a roller, or the
    phalanges of a hand.
    """
    chain = params.chain
    poses = chain.frames(np.zeros(len(chain.joints)))
    parents = (BASE, *(joint.name for joint in chain.joints[:-1]))
    tree = {
        joint.name: Link(joint.name, parent, joint.kind, pose, joint.lower, joint.upper)
        for joint, parent, pose in zip(chain.joints, parents, poses[:-1], strict=True)
    }
    for passive in LINKAGES[arm].joints:
        leader = tree[passive.follows]
        pose = leader.pose.copy()
        pose[:3, 3] = passive.pivot
        lower, upper = sorted((passive.ratio * leader.lower, passive.ratio * leader.upper))
        tree[passive.name] = Link(
            passive.name,
            passive.parent,
            leader.kind,
            pose,
            lower,
            upper,
            Follow(passive.follows, passive.ratio),
        )
    if isinstance(params, MountedPsm) and (jaw := params.tool.jaw) is not None:
        wrist = tree[chain.joints[-1].name]
        for name, turn in zip(FINGERS, (np.eye(4), _HALF_TURN), strict=True):
            tree[name] = Link(name, wrist.name, "revolute", wrist.pose @ turn, jaw.lower / 2, jaw.upper / 2)
        tree |= {pad.name: pad for pad in _pads(params.tool, wrist.pose, poses[-1][:3, 2])}
    if isinstance(params, MountedPsm) and (hand := params.tool.hand) is not None:
        shaft = tree[chain.joints[-1].name].pose
        for bone in hand.links:
            tree[bone.name] = Link(
                bone.name, bone.parent, "revolute", shaft @ bone.pose, bone.phalanx.lower, bone.phalanx.upper
            )
    return tuple(tree.values())


def _pads(tool: Instrument, wrist: Vector, ahead: Vector) -> Iterator[Link]:
    """Yield the pads of a roller, each in its finger: the left one slides ahead, the right one back."""
    if (roller := tool.roller) is None:
        return
    for name, finger, way in zip(PADS, FINGERS, (ahead, -ahead), strict=True):
        pose = wrist.copy()
        pose[:3, :3] = np.column_stack([wrist[:3, 2], np.cross(way, wrist[:3, 2]), way])
        reach = roller.wire_radius * roller.joint.upper
        yield Link(name, finger, "prismatic", pose, -reach, reach)


_HALF_TURN = np.diag([1.0, -1.0, -1.0, 1.0])
"""About x: the right finger opens the other way."""
