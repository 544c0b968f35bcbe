"""The light of an endoscope: two ends of glass fibre beside the lens."""

from __future__ import annotations

import numpy as np
from mujoco import mjrf

from schemas.vectors import Vector

__all__ = ["Lamp", "RoomLamp"]

_ASIDE, _BACK = 5.5e-3, 1.0e-3
"""Distance of either end from the middle of the lens, sideways and backwards, m: a tip of 12 mm."""
_ENDS = (1000.0, True), (700.0, False)
"""Intensity of either end along its axis, candela, and whether it casts shadows: chosen by eye for tissue at
80 mm, with the renderer's exposure. A second shadow would cost a fifth of a picture without a GPU.
"""
_CUTOFF_DEG, _SOFTNESS = 52.0, 1.0
"""Half the angle of the cone of light, and its soft share. Fibre of a numerical aperture of 0.6 to 0.9 lights
37 to 64 degrees.
"""
_COLOUR = (1.0, 0.975, 0.94)
"""Xenon through a light guide: nearly white, a little yellow."""
_BULB = 1.3e-3
"""Radius of a bundle of fibres, m."""
_ROOM_LUX, _ROOM_COLOUR = 45_000.0, (1.0, 0.96, 0.9)
_ROOM_DIRECTION = np.array([0.45, 0.3, -1.0], np.float32)
"""Light, colour and direction of the lamp of a dry lab, beside the intensity of the endoscope's own."""
_RANGE = 1.0
"""m; light farther away is left out."""


class Lamp:
    """Both ends, in a scene."""

    def __init__(self, context: mjrf.Context, scene: mjrf.Scene, shadow_pixels: int, colour: Vector) -> None:
        """`shadow_pixels`: side of the shadow map; 0: no shadows. `colour`: factors of the usual colour."""
        self._ends = [
            context.create_light(
                mjrf.LightParams(
                    type=mjrf.LightType.LIGHT_SPOT,
                    color=colour * _COLOUR,
                    intensity=candela,
                    cast_shadow=shadow and shadow_pixels > 0,
                    range=_RANGE,
                    cutoff=_CUTOFF_DEG,
                    softness=_SOFTNESS,
                    shadow_map_size=shadow_pixels,
                    bulb_radius=_BULB,
                )
            )
            for candela, shadow in _ENDS
        ]
        for end in self._ends:
            scene.add_light(end)

    def dim(self, factor: float) -> None:
        """Set the intensity to a factor of the usual one."""
        for end, (candela, _) in zip(self._ends, _ENDS, strict=True):
            end.set_intensity(factor * candela)

    def aim(self, pose: Vector) -> None:
        """Put the lamp around a lens; `pose`: the optical frame, shape (4, 4)."""
        right, _, ahead, middle = pose[:3, :4].T
        for end, side in zip(self._ends, (-1.0, 1.0), strict=True):
            place = middle + side * _ASIDE * right - _BACK * ahead
            end.set_pose(place.astype(np.float32), ahead.astype(np.float32))


class RoomLamp:
    """The lamp over the table of a dry lab, far away."""

    def __init__(self, context: mjrf.Context, scene: mjrf.Scene, shadow_pixels: int, colour: Vector) -> None:
        """`shadow_pixels`: side of the shadow map; 0: no shadows. `colour`: factors of the usual colour."""
        self._light = context.create_light(
            mjrf.LightParams(
                type=mjrf.LightType.LIGHT_DIRECTIONAL,
                color=colour * _ROOM_COLOUR,
                intensity=_ROOM_LUX,
                cast_shadow=shadow_pixels > 0,
                shadow_map_size=shadow_pixels,
            )
        )
        self._light.set_pose(np.array([0.0, 0.0, 1.0], np.float32), _ROOM_DIRECTION)
        scene.add_light(self._light)

    def dim(self, factor: float) -> None:
        """Set the intensity to a factor of the usual one, as the exposure of the camera follows the light."""
        self._light.set_intensity(factor * _ROOM_LUX)
