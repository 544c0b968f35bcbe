"""The arms whose dynamics can be identified: what moves, what turns it, and what is known beforehand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from robots.dvrk import drives, ecm, inertia, linkage, psm
from robots.dvrk.drives import FINGERS, Drive
from robots.dvrk.inertia import Inertia
from robots.dvrk.instruments import Instrument
from robots.dvrk.linkage import Linkage
from robots.dvrk.own_dynamics import JAW
from robots.serial_chain import Joint, SerialChain

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
"""Whose pseudo-inertias are found; the instrument's own bodies weigh grams and keep their known masses."""


class IdentifiedArm(NamedTuple):
    """One arm with what it holds; n joints, those of the chain first, then the jaw if it is one of them."""

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
    discs: tuple[drives.Disc, ...]
    """Published; the shares are of these joints."""
    start: tuple[float, ...]
    """Where the arm homes, its jaw half open; rad and m, shape (n,)."""


def of_psm(tool: Instrument, *, jaw: bool = False) -> IdentifiedArm:
    """Return a PSM with `tool`; `jaw`: its jaw is a joint too, else it stands still."""
    chain, bodies, driven = psm.chain(tool), inertia.psm(tool), dict(drives.psm(tool))
    joints, discs, start = chain.joints, drives.discs(tool), psm.home(tool)
    if jaw and tool.jaw is not None:
        # below 0 the fingers press on each other
        joints, start = (*joints, replace(tool.jaw.joint, lower=0.0)), (*start, tool.jaw.upper / 2.0)
        # two fingers that turn by half the angle, each with the torque of the whole
        finger = driven[FINGERS[0]]
        driven[JAW] = replace(finger, armature=finger.armature / 2.0, elasticity=finger.elasticity / 2.0)
        discs = tuple(
            replace(disc, shares={**disc.shares, JAW: disc.shares.get(FINGERS[0], 0.0)}) for disc in discs
        )
    return IdentifiedArm(
        tool=tool.name,
        chain=chain,
        bars=linkage.PSM,
        bodies={name: bodies[name] for name in _PSM_BODIES},
        carried={name: body for name, body in bodies.items() if name not in _PSM_BODIES},
        joints=joints,
        drives={joint.name: driven[joint.name] for joint in joints},
        discs=discs,
        start=start,
    )


def of_ecm() -> IdentifiedArm:
    """Return the ECM; its endoscope is among the bodies to be found."""
    chain = ecm.chain()
    return IdentifiedArm(
        tool="endoscope",
        chain=chain,
        bars=linkage.ECM,
        bodies=inertia.ecm(),
        carried={},
        joints=chain.joints,
        drives=drives.ECM,
        discs=(),
        start=ecm.HOME,
    )
