"""Look of the setup joints that carry an arm.

Each link is drawn in its joint's DH frame (z up except for the tilt) and carried to the cart's. Outer
dimensions: bounding boxes of the CAD meshes in jhu-dvrk/dvrk_model (SUJ, Classic); axes:
`robots.dvrk.setup_joints`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from manifold3d import Manifold

from engines.mujoco.looks.part import DARK, GREY, IVORY, Looks, Material
from engines.mujoco.looks.solids import (
    block,
    circle,
    outline,
    part,
    place_solid,
    plate,
    revolve,
    rod,
    taper,
    union,
)
from robots.dvrk.setup_joints import JOINT_NAMES, CartArm, chain

__all__ = ["parts"]

_HUB = 0.0725
"""Radius of the shoulder, m."""
_ELBOW = 0.0600
"""Radius of the forearm's hub on the elbow, m."""
_WRIST = 0.0539
"""Radius of the wrist, m."""
_UPPER_ARM = (-0.0856, 0.0856)
"""Heights of the upper arm over its frame, m."""
_FOREARM = (-0.0573, 0.0571)
"""Heights of the forearm over its frame, m; its cap reaches 0.1677 m."""

Solids = Mapping[str, tuple[tuple[Manifold, Material], ...]]


def parts(arm: CartArm) -> Looks:
    """Return the meshes of the setup joint that carries `arm`, by joint name."""
    frames = chain(arm).frames(np.zeros(len(JOINT_NAMES)))
    drawn: Solids = {
        "lift": _lift(0.2549 if arm == "PSM3" else 0.3311),
        "shoulder": _shoulder_solids(chain(arm).joints[2].a, 0.1733 if arm == "PSM3" else 0.2084),
        "elbow": _elbow_solids(chain(arm).joints[3].a, upside_down=arm == "PSM3"),
        "wrist": _ecm_wrist() if arm == "ECM" else _wrist(above=arm == "PSM3"),
        "tilt": () if arm == "ECM" else _tilt_solids(),
        "mount": ((rod((0.0, 0.0, -0.014), (0.0, 0.0, 0.0), 0.050), DARK),),
    }
    return {
        joint: tuple(
            part(f"{joint}_{i}", place_solid(solid, frame[:3, :3], frame[:3, 3]), material)
            for i, (solid, material) in enumerate(drawn[joint])
        )
        for joint, frame in zip(JOINT_NAMES, frames[:-1], strict=True)
    }


def _lift(height: float) -> tuple[tuple[Manifold, Material], ...]:
    """Sledge on the column's rail, and the shoulder's bearing before it."""
    post = revolve([(0.0, 0.0), (_HUB - 0.012, 0.0), (_HUB, 0.012), (_HUB, height), (0.0, height)])
    neck = block((-0.095, -0.060, 0.02), (0.0, 0.060, height - 0.02))
    sledge = block((-0.1137, -0.0724, 0.0), (-0.092, 0.0724, height), 0.004)
    return (union(post, neck), IVORY), (sledge, DARK)


def _shoulder_solids(length: float, top: float) -> tuple[tuple[Manifold, Material], ...]:
    """Upper arm from the shoulder to the elbow."""
    low, high = _UPPER_ARM
    beam = plate("z", taper(((0.0, 0.0), _HUB), ((length, 0.0), 0.0668)), low + 0.004, high)
    cap = revolve([(0.0, high - 0.01), (0.062, high - 0.01), (0.062, top - 0.014), (0.048, top), (0.0, top)])
    return (union(beam, cap), IVORY), (rod((0.0, 0.0, low), (0.0, 0.0, low + 0.010), 0.066), DARK)


def _elbow_solids(length: float, *, upside_down: bool) -> tuple[tuple[Manifold, Material], ...]:
    """Forearm from the elbow to the wrist, with the wrist's brake in a cap on the side away from the arm.

    PSM3's forearm is turned over.
    """
    low, high = _FOREARM
    beam = plate("z", taper(((0.0, 0.0), _ELBOW), ((length, 0.0), _WRIST)), low + 0.004, high)
    cap = revolve([(0.0, high - 0.01), (0.044, high - 0.01), (0.044, 0.154), (0.032, 0.1677), (0.0, 0.1677)])
    bearings = [rod((0.0, 0.0, low), (0.0, 0.0, low + 0.010), 0.054)]
    if upside_down:
        return (union(beam, cap.mirror((0.0, 0.0, 1.0)).translate((length, 0.0, 0.0))), IVORY), (
            bearings[0],
            DARK,
        )
    bearings.append(rod((length, 0.0, low), (length, 0.0, low + 0.010), 0.049))
    return (union(beam, cap.translate((length, 0.0, 0.0))), IVORY), (union(*bearings), DARK)


def _wrist(*, above: bool) -> tuple[tuple[Manifold, Material], ...]:
    """Bearing of the tilt axis, which runs along -y, under the forearm or, for PSM3, on a post above it."""
    low, high = (-0.1999, 0.0478) if above else (-0.0477, 0.0731)
    post = rod((0.0, 0.0, low), (0.0, 0.0, high if not above else 0.0), _WRIST - 0.002)
    tube = revolve(
        [(0.0, 0.0), (0.036, 0.0), (0.0475, 0.012), (0.0475, 0.212), (0.0, 0.212)],
        (0.0, 0.162, 0.0),
        (0.0, -1.0, 0.0),
    )
    return (union(post, tube), IVORY), (rod((0.0, -0.050, 0.0), (0.0, -0.061, 0.0), 0.042), DARK)


def _ecm_wrist() -> tuple[tuple[Manifold, Material], ...]:
    """Post under the forearm that bends by 45 degrees to the ECM's mount."""
    frames = chain("ECM").frames(np.zeros(len(JOINT_NAMES)))
    turn, origin = frames[3][:3, :3], frames[3][:3, 3]
    mount = turn.T @ (frames[5][:3, 3] - origin)
    normal = turn.T @ frames[5][:3, 2]
    post = revolve([(0.0, 0.0), (0.030, 0.0), (_WRIST, 0.03), (_WRIST, 0.2888), (0.0, 0.2888)])
    start, end = mount - 0.080 * normal, mount - 0.012 * normal
    pad = rod((start[0], start[1], start[2]), (end[0], end[1], end[2]), 0.050)
    foot = plate("z", circle((0.0, 0.0), 0.050), 0.02, 0.16)
    return (union(post, Manifold.batch_hull([foot, pad])), IVORY), (
        rod((0.0, 0.0, 0.275), (0.0, 0.0, 0.2888), 0.055),
        DARK,
    )


def _tilt_solids() -> tuple[tuple[Manifold, Material], ...]:
    """Bracket from the tilt axis, -z, down (-y) and forward under the manipulator, to the mount's axis.

    The origin of the frame is on the mount's axis.
    """
    hub = rod((0.0, 0.0, -0.348), (0.0, 0.0, -0.296), 0.048)
    upright = plate(
        "x",
        outline(
            [
                (-0.21, -0.344),
                (0.0, -0.344),
                (0.0, -0.296),
                (-0.16, -0.296),
                (-0.2289, -0.23),
                (-0.2289, -0.32),
            ]
        ),
        -0.048,
        0.048,
    )
    foot = plate("y", taper(((-0.26, 0.0), 0.045), ((0.0, 0.0), 0.0444)), -0.2289, -0.175)
    post = rod((0.0, -0.18, 0.0), (0.0, -0.1169, 0.0), 0.0430)
    return (union(hub, upright, foot), IVORY), (post, GREY)
