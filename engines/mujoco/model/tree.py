"""The links of an arm as a tree, each with its pose in `<arm>_base` while every joint is at 0.

The main chain has the frames of the arm's modified DH table: the tip is exact. The bars of the linkage and
the end effector hang on the main chain; the axis of every joint is z of the link's frame.
"""

from __future__ import annotations

import numpy as np

from robots.dvrk.link import Follow, Link
from robots.dvrk.linkage import LINKAGES
from robots.dvrk.mounted import MountedArm
from robots.dvrk.setup_joints import CartArm

__all__ = ["BASE", "links"]

BASE = "base"
"""The fixed link; the origin of the frame is the remote centre of motion."""


def links(arm: CartArm, params: MountedArm) -> tuple[Link, ...]:
    """Return all moving links of `arm`, parents before children.

    The order: joints, linkage, end effector.
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
    return *tree.values(), *params.end_effector_links
