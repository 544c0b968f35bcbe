"""The electrode of cautery hooks and spatulas."""

from __future__ import annotations

from engines.mujoco.looks.fingers import finger_frame
from engines.mujoco.looks.part import DARK, STEEL, Looks
from engines.mujoco.looks.solids import block, part, place_solid, rod, union
from robots.dvrk.end_effectors.electrode import Electrode
from robots.dvrk.end_effectors.end_effector import Mount

__all__ = ["parts"]

_BARE = 0.0035
"""Length of the wire without insulation, m."""


def parts(electrode: Electrode, _instrument: str, mount: Mount) -> Looks:
    """Return an insulated stem with a bare end: a foot aside, or a flat blade."""
    pose, r = finger_frame(mount), electrode.radius
    end, sleeve = electrode.length - r, electrode.length - _BARE
    wire = rod((0.0, 0.0, 0.0), (0.0, 0.0, end), r)
    if electrode.foot:
        wire = union(wire, rod((0.0, r, end), (0.0, r - electrode.foot, end), r))
    else:
        wire = union(wire, block((-0.5 * r, -2.0 * r, sleeve), (0.5 * r, 2.0 * r, electrode.length)))
    insulation = rod((0.0, 0.0, 0.0), (0.0, 0.0, sleeve), electrode.sleeve)
    solids = (("electrode", wire - insulation, STEEL), ("insulation", insulation, DARK))
    placed = tuple(
        part(name, place_solid(solid, pose[:3, :3], pose[:3, 3]), stuff) for name, solid, stuff in solids
    )
    return {mount.link: placed}
