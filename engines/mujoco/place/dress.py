"""Physically based materials for the robot, boards and objects of a scene."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco

__all__ = ["BRIGHT", "SHINING", "dress_scene"]

_METALS: Mapping[str, float] = {"steel": 0.27}
"""Roughness of metals of the robot, by material."""
_ROUGHNESS: Mapping[str, float] = {"black": 0.42, "blue": 0.4, "dark": 0.5, "ivory": 0.35}
"""Roughness of coats and plastics of the robot, by material; black: the matt coat of a shaft."""
_PLASTIC, BRIGHT = "plastic", "bright metal"
"""Materials of geoms without a material."""
SHINING = ("needle",)
"""Objects of metal, by the beginning of their bodies' names."""


def dress_scene(scene: mujoco.MjSpec, exposure: float, tone: str) -> None:
    """Give every geom of `scene` a material of metal, coat or plastic; colours stay.

    A material without such a property is drawn by another shader, which has to be compiled as well.

    Args:
        scene: to be drawn by Filament.
        exposure: of the camera, stops.
        tone: the renderer's name of a tone mapping.
    """
    for material in scene.materials:
        material.metallic = 1.0 if material.name in _METALS else 0.0
        material.roughness = _METALS.get(material.name, _ROUGHNESS.get(material.name, 0.45))
    scene.add_material(name=_PLASTIC, metallic=0.0, roughness=0.4)
    scene.add_material(name=BRIGHT, metallic=1.0, roughness=0.22)
    for geom in scene.geoms:
        if not geom.material:
            geom.material = BRIGHT if geom.parent.name.startswith(SHINING) else _PLASTIC
    for option, value in {"ao.enabled": 0.0, "cg.exposure": exposure}.items():
        scene.add_numeric(name=f"filament.{option}", data=[value], size=1)
    for option, text in {"shadows.type": "pcf", "cg.tone_mapping": tone}.items():
        scene.add_text(name=f"filament.{option}", data=text)
