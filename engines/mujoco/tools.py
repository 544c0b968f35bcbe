"""Instruments of a scene as tools that touch tissue."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hub.participant import Tool
from robots.dvrk.end_effectors.electrode import Electrode
from robots.dvrk.end_effectors.probe import Probe
from robots.dvrk.end_effectors.scissors import Scissors
from robots.dvrk.end_effectors.suction_tube import SuctionTube
from robots.dvrk.mounted.mounted_psm import MountedPsm
from schemas.vectors import Vector

__all__ = ["instrument_tools"]


def _energy(mounted: MountedPsm) -> dict[str, Any]:
    """Return the mode of an energy instrument; the stem of an electrode is insulated."""
    mode: dict[str, Any] = {"mode": mounted.tool.energy}
    if isinstance(electrode := mounted.end_effector, Electrode):
        mode["bare"] = len(electrode.bare(mounted.tool.tip))
    return mode


def instrument_tools(arm: str, mounted: MountedPsm, base: Vector) -> Iterator[Tool]:
    """Yield the instruments of an arm with its base frame at `base`, pose in the world, shape (4, 4).

    The tool of a spare instrument, `PSM1_<spare>`, is far away while out of use.
    """
    for owner, one in mounted.by_owner(arm).items():
        yield _tool(arm, owner, one, base)


def _tool(arm: str, owner: str, mounted: MountedPsm, base: Vector) -> Tool:
    is_probe, spheres = isinstance(mounted.end_effector, Probe), mounted.spheres
    probe: dict[str, Any] = {}
    if is_probe:
        probe = {"radius": mounted.probe_radius}
    elif spheres:
        radii = [sphere.radius for sphere in spheres]
        probe = {"spheres": len(spheres), "radius": radii[0] if len(set(radii)) == 1 else radii}
        if isinstance(jaw := mounted.tool.jaw, Scissors):
            left, right = jaw.edges
            probe["scissors"] = {"left": left, "right": right, "hinge": jaw.hinge}
        elif jaw is not None:
            probe["grasp"] = {}
        probe |= {"energy": _energy(mounted)} if mounted.tool.energy else {}
        if isinstance(mounted.end_effector, SuctionTube):
            probe |= {"suction": {}, "irrigation": {}}
        if clip := mounted.tool.clip:
            probe["clip"] = {"length": clip.length, "diameters": clip.diameters}
    return Tool(
        name=owner.replace("/", "_"),
        touches=mounted.touches,
        path=("arms", arm, "touches"),
        bond=f"{owner}/{'probe' if is_probe else 'contact'}" if probe else "",
        probe=probe,
        tip=f"{arm}/measured_cp",
        base=base,
        reach=mounted.reach,
        spheres=mounted.sphere_centres,
        is_spare=owner != arm,
    )
