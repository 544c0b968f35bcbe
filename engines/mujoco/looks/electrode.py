"""The electrode of cautery hooks and spatulas."""

from __future__ import annotations

from engines.mujoco.looks.fingers import finger_frame
from engines.mujoco.looks.part import STEEL, Looks
from engines.mujoco.looks.solids import block, part, place_solid, rod, union
from robots.dvrk.end_effectors.electrode import Electrode
from robots.dvrk.end_effectors.end_effector import Mount

__all__ = ["parts"]


def parts(electrode: Electrode, _instrument: str, mount: Mount) -> Looks:
    """Return a stem with a hooked end."""
    pose = finger_frame(mount)
    stem = rod((0.0, 0.0, 0.0), (0.0, 0.0, electrode.length - 0.0025), 0.0008)
    hook = block((-0.0006, -0.0018, electrode.length - 0.0030), (0.0006, 0.0008, electrode.length))
    solid = place_solid(union(stem, hook), pose[:3, :3], pose[:3, 3])
    return {mount.link: (part("electrode", solid, STEEL),)}
