"""Physically based materials for the robot, boards and objects of a scene."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import mujoco

__all__ = ["BRIGHT", "SHINING", "dress_scene"]

_METALS: Mapping[str, float] = {"steel": 0.27}
"""Roughness of metals of the robot, by material."""
_ROUGHNESS: Mapping[str, float] = {"black": 0.42, "blue": 0.4, "dark": 0.5, "ivory": 0.35}
"""Roughness of coats and plastics of the robot, by material; black: the matt coat of a shaft."""
_PLASTIC, _PAPER, BRIGHT = "plastic", "paper", "bright metal"
"""Materials of geoms without a material."""
_THICKEST, _SMOKE = 12.0, [0.5, 0.5, 0.52]
"""Extinction of the thickest smoke, 1/m, and the light it scatters."""
SHINING = ("needle",)
"""Objects of metal, by the beginning of their bodies' names."""


def dress_scene(
    scene: mujoco.MjSpec, exposure: float, tone: str, smoke: float, printed: Collection[str] = ()
) -> None:
    """Give every geom of `scene` a material of metal, coat or plastic; colours stay.

    A material without such a property is drawn by another shader, which has to be compiled as well.

    Args:
        scene: to be drawn by Filament.
        exposure: of the camera, stops.
        tone: the renderer's name of a tone mapping.
        smoke: from 0 to 1.
        printed: bodies of matt paper, without highlights that a program would take for a mark.
    """
    for material in scene.materials:
        material.metallic = 1.0 if material.name in _METALS else 0.0
        material.roughness = _METALS.get(material.name, _ROUGHNESS.get(material.name, 0.45))
    scene.add_material(name=_PLASTIC, metallic=0.0, roughness=0.4)
    scene.add_material(name=_PAPER, metallic=0.0, roughness=0.95)
    scene.add_material(name=BRIGHT, metallic=1.0, roughness=0.22)
    for geom in scene.geoms:
        if not geom.material:
            name = geom.parent.name
            plain = _PAPER if name.partition("/")[0] in printed else _PLASTIC
            geom.material = BRIGHT if name.startswith(SHINING) else plain
    options = {"ao.enabled": 0.0, "cg.exposure": exposure} | (_smoke_options(smoke) if smoke else {})
    for option, value in options.items():
        data = value if isinstance(value, list) else [value]
        scene.add_numeric(name=f"filament.{option}", data=data, size=len(data))
    for option, text in {"shadows.type": "pcf", "cg.tone_mapping": tone}.items():
        scene.add_text(name=f"filament.{option}", data=text)


def _smoke_options(smoke: float) -> dict[str, float | list[float]]:
    """Return the renderer's options of fog, the same everywhere."""
    return {
        "fog.enabled": 1.0,
        "fog.density": _THICKEST * smoke,
        "fog.color": _SMOKE,
        "fog.distance": 0.0,
        "fog.height_falloff": 0.0,
        "fog.maximum_opacity": 1.0,
    }
