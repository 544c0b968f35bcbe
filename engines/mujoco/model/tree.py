"""The links of an arm as a tree, each with its pose in `<arm>_base` while every joint is at 0.

The main chain has the frames of the arm's modified DH table: the tip is exact. The bars of the linkage and
the end effector hang on the main chain; the axis of every joint is z of the link's frame.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engines.mujoco.model.names import PARKED_M, SEAT
from robots.dvrk.link import Follow, Link
from robots.dvrk.linkage import LINKAGES
from robots.dvrk.mounted.mounted_arm import MountedArm
from robots.dvrk.psm import ARM_JOINTS
from robots.dvrk.setup_joints import DrivenArm

__all__ = ["BASE", "links", "spare_links"]

BASE = "base"
"""The fixed link; the origin of the frame is the remote centre of motion."""


def links(arm: DrivenArm, params: MountedArm) -> tuple[Link, ...]:
    """Return all moving links of `arm`, parents before children.

    The order: joints, linkage, end effector. An arm with spare instruments has a seat under the roll.
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
    if len(params.variants) > 1:
        tree = _seat_roll(tree)
    return *tree.values(), *params.end_effector_links


def spare_links(arm: DrivenArm, spare: MountedArm) -> tuple[Link, ...]:
    """Return the moving links of a spare instrument, the seat first, parents before children."""
    shared = {joint.name for joint in ARM_JOINTS} | {one.name for one in LINKAGES[arm].joints}
    tree = _seat_roll({link.name: link for link in links(arm, spare)})
    return tuple(link for name, link in tree.items() if name not in shared)


def _seat_roll(tree: dict[str, Link]) -> dict[str, Link]:
    """Return `tree` with a seat between insertion and roll."""
    carriage, seated = tree["insertion"], dict[str, Link]()
    for name, link in tree.items():
        if name == "roll":
            seated[SEAT] = Link(SEAT, "insertion", "prismatic", carriage.pose, -PARKED_M, 0.0)
            link = replace(link, parent=SEAT)
        seated[name] = link
    return seated
