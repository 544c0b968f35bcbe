"""Arms with identifiable dynamics: bodies, drives, and known parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from robots.dvrk import arm_bodies, drives, ecm, linkage, psm
from robots.dvrk.drive import Disc, Drive
from robots.dvrk.end_effectors.jaw import FINGER_PAIRS, FINGERS
from robots.dvrk.inertia import Inertia
from robots.dvrk.instruments import Instrument
from robots.dvrk.linkage import Linkage
from robots.dvrk.own_dynamics import JAW
from robots.serial_chain import Joint, SerialChain
from schemas.plain_sum import plain_sum

__all__ = ["IdentifiedArm", "of_ecm", "of_psm"]

_PSM_BODIES = (
    "yaw",
    "pitch",
    "insertion",
    "pitch_back",
    "pitch_front",
    "pitch_bottom",
    "pitch_top",
    "counterweight",
)
"""Bodies with identified pseudo-inertias; bodies of the instrument weigh grams and keep their known masses.
"""


class IdentifiedArm(NamedTuple):
    """An arm with its instrument; n joints, first the joints of the chain, then optionally the jaw."""

    tool: str
    """Instrument or endoscope."""
    chain: SerialChain
    bars: Linkage
    bodies: Mapping[str, Inertia]
    """Published, of the bodies to be found."""
    carried: Mapping[str, Inertia]
    """Known, of all others."""
    joints: tuple[Joint, ...]
    drives: Mapping[str, Drive]
    """Published, by joint."""
    discs: tuple[Disc, ...]
    """Published; the shares are of these joints."""
    fingers: tuple[Disc, ...]
    """Rubbing pairs of the fingers where the jaw is a joint; the shares are of these joints."""
    start: tuple[float, ...]
    """Home position of the arm, jaw half open; rad and m, shape (n,)."""


def of_psm(tool: Instrument, *, jaw: bool = False) -> IdentifiedArm:
    """Return a PSM with `tool`; `jaw`: the jaw is a joint too, otherwise at rest."""
    chain, bodies, driven = psm.chain(tool), arm_bodies.psm(tool), dict(drives.psm(tool))
    joints, discs, start = chain.joints, drives.discs(tool), psm.home(tool)
    fingers = ()
    if jaw and tool.jaw is not None:
        # below 0 the fingers press on each other
        joints, start = (*joints, replace(tool.jaw.joint, lower=0.0)), (*start, tool.jaw.upper / 2.0)
        # two fingers that turn by half the angle, each with the torque of the whole
        finger = driven[FINGERS[0]]
        driven[JAW] = replace(finger, armature=finger.armature / 2.0, elasticity=finger.elasticity / 2.0)
        discs, fingers = (tuple(map(_with_jaw, pairs)) for pairs in (discs, FINGER_PAIRS))
    return IdentifiedArm(
        tool=tool.name,
        chain=chain,
        bars=linkage.PSM,
        bodies={name: bodies[name] for name in _PSM_BODIES},
        carried={name: body for name, body in bodies.items() if name not in _PSM_BODIES},
        joints=joints,
        drives={joint.name: driven[joint.name] for joint in joints},
        discs=discs,
        fingers=fingers,
        start=start,
    )


def _with_jaw(pair: Disc) -> Disc:
    """Return a rubbing pair with a share of the jaw: each finger turns by half the angle."""
    return replace(
        pair, shares={**pair.shares, JAW: plain_sum(pair.shares.get(one, 0.0) for one in FINGERS) / 2.0}
    )


def of_ecm() -> IdentifiedArm:
    """Return the ECM; the endoscope is among the identified bodies."""
    chain = ecm.chain()
    return IdentifiedArm(
        tool="endoscope",
        chain=chain,
        bars=linkage.ECM,
        bodies=arm_bodies.ecm(),
        carried={},
        joints=chain.joints,
        drives=drives.ECM,
        discs=(),
        fingers=(),
        start=ecm.HOME,
    )
