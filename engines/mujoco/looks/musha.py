"""Look of the MUSHA hand at the end of a PSM's shaft: palm and phalanges, and collision capsules.

Drawn in the PSM's base frame with every joint at 0, a phalanx in the frame of the link: x along the phalanx,
y to the closing side, z along the joint's axis. Forms are ours, within the radius of the phalanges and, for
the palm, of the trocar.
"""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

from engines.mujoco.looks.part import BLACK, DARK, STEEL, Collisions, Looks, Part, Primitive
from engines.mujoco.looks.solids import block, part, place_solid, revolve, rod, union
from robots.dvrk.end_effectors.end_effector import Mount
from robots.dvrk.end_effectors.hand import Hand, HandLink
from robots.dvrk.end_effectors.musha import TROCAR_RADIUS
from robots.dvrk.instruments import SHAFT_RADIUS
from schemas.vectors import Vector

__all__ = ["collision", "parts"]

_HUB, _EAR = 0.0016, 0.0020
"""Half widths along a joint's axis: of the hub, and from where to where of the ears at its sides, m; an ear
ends at the radius of the finger's corners.
"""
_EAR_END = 0.0023
_SEGMENTS = 10


def parts(hand: Hand, _instrument: str, mount: Mount) -> Looks:
    """Return the meshes of palm and phalanges by body."""
    looks: dict[str, tuple[Part, ...]] = {mount.link: (_palm_solids(hand, mount.pose),)}
    for link in hand.bones:
        looks[link.name] = _phalanx_solids(hand, link, mount.pose @ link.pose)
    return looks


def collision(hand: Hand, _instrument: str, mount: Mount) -> Collisions:
    """Return by body the capsule of each phalanx, from joint to joint or to the centre of the fingertip."""
    shapes: dict[str, tuple[Primitive, ...]] = {}
    for link in hand.bones:
        frame, half = mount.pose @ link.pose, link.phalanx.length / 2.0
        pose = np.eye(4)
        # a capsule lies along z
        pose[:3, 0], pose[:3, 1], pose[:3, 2] = frame[:3, 1], frame[:3, 2], frame[:3, 0]
        pose[:3, 3] = frame[:3, 3] + half * frame[:3, 0]
        shapes[link.name] = (Primitive(link.name, "capsule", (hand.radius, half), pose),)
    return shapes


def _palm_solids(hand: Hand, shaft: Vector) -> Part:
    """A disc wider than the shaft, with a pair of ears for each finger."""
    radius, top = TROCAR_RADIUS - 1e-4, hand.palm - hand.radius
    body = revolve(
        [(0.0, -0.004), (SHAFT_RADIUS, -0.004), (radius, 0.0), (radius, top), (0.0, top)], segments=14
    )
    first = [link for link in hand.bones if link.parent == "roll"]
    ears = [
        place_solid(_ear_solids(0.0, top - hand.palm), link.pose[:3, :3], link.pose[:3, 3]) for link in first
    ]
    return part("palm", place_solid(union(body, *ears), shaft[:3, :3], shaft[:3, 3]), STEEL)


def _ear_solids(end: float, start: float) -> Manifold:
    """Return two cheeks beside a hub at x = `end`, from x = `start`."""
    cheek = block((start, -0.0012, _EAR - 0.0003), (end + 0.0012, 0.0012, _EAR_END - 0.0002))
    return cheek + cheek.mirror((0.0, 0.0, 1.0))


def _phalanx_solids(hand: Hand, link: HandLink, pose: Vector) -> tuple[Part, ...]:
    """Return a hub in the joint, a barrel, a pad on the closing side, and ears or a round fingertip.

    The ears hold the next joint.
    """
    length, radius, is_last = link.phalanx.length, hand.radius, link.phalanx is hand.phalanges[-1]
    gap = 0.0020
    end = length if is_last else length - gap
    hub = rod((0.0, 0.0, -_HUB), (0.0, 0.0, _HUB), 0.0013, segments=_SEGMENTS)
    neck = block((0.0, -0.0012, -_HUB), (gap, 0.0012, _HUB))
    profile = [(0.0, gap - 0.0002), (0.85 * radius, gap - 0.0002), (radius, gap + 0.0008)]
    if is_last:
        profile += [
            (radius * np.cos(a), end + radius * np.sin(a)) for a in np.radians([0.0, 30.0, 60.0]).tolist()
        ] + [(0.0, end + radius)]
    else:
        profile += [(radius, end - 0.0006), (0.85 * radius, end), (0.0, end)]
    barrel = revolve(profile, axis=(1.0, 0.0, 0.0), segments=_SEGMENTS)
    pad = barrel ^ block((gap + 0.0012, 0.55 * radius, -1.0), (1.0 if is_last else end - 0.0010, 1.0, 1.0))
    solids = [hub, neck, barrel - pad]
    if not is_last:
        solids.append(_ear_solids(length, end - 0.0004))
    finished = ((link.name, union(*solids), STEEL), (f"{link.name}_pad", pad, DARK if not is_last else BLACK))
    return tuple(
        part(name, place_solid(solid, pose[:3, :3], pose[:3, 3]), material)
        for name, solid, material in finished
    )
