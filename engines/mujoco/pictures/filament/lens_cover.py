"""Water and dirt on the lens of an endoscope."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from engines.mujoco.pictures.sensor_params import LensEvent, SensorParams
from engines.mujoco.textures.noise import Noise
from engines.mujoco.textures.surface import smooth_step

__all__ = ["LensCover"]

_VEIL = np.array([205.0, 208.0, 210.0], np.float32)
"""Colour of water on the lens, lit from the tip, grey levels."""
_SMEAR = np.array([96.0, 44.0, 30.0], np.float32)
"""Colour of fat and blood on the lens, grey levels."""
_SPREAD = 16
"""Pixels of 320 over which water spreads the light of a point."""
_SEED = 11


class LensCover:
    """Fog and dirt on both lenses, by simulated time."""

    def __init__(self, params: SensorParams, width: int, height: int) -> None:
        self._shape = height, width
        self._fog = _curve(params.fog, [(event, event.fog) for event in params.events])
        self._dirt = _curve(params.dirt, [(event, event.dirt) for event in params.events])

    def cover(self, picture: NDArray[np.uint8], time_ns: int, eye: int) -> NDArray[np.uint8]:
        """Return a picture, shape (height, width, 3), as it is behind what is on the lens at a time."""
        fog, dirt = (float(np.interp(time_ns, *curve)) for curve in (self._fog, self._dirt))
        if not fog and not dirt:
            return picture
        spread = _blur(picture, max(2, _SPREAD * self._shape[1] // 320))
        drops, smears = self._patterns[eye]
        # dirt passes less light and spreads the rest
        share = dirt * smears[..., None]
        found = picture + share * (0.45 * spread + 0.35 * _SMEAR - picture)
        share = np.minimum(fog * (0.6 + 0.6 * drops), 1.0)[..., None]
        bright = np.float32(0.25 + 0.75 * spread.mean() / 255.0)
        found += share * (0.55 * spread + 0.45 * bright * _VEIL - found)
        return np.clip(found + np.float32(0.5), 0.0, 255.0).astype(np.uint8)

    @cached_property
    def _patterns(self) -> list[NDArray[np.float32]]:
        """Thickness of water, and share of dirt, from 0 to 1, shape (2, height, width), for each eye."""
        noise, (height, width) = Noise(_SEED), self._shape
        x, y = np.meshgrid(np.linspace(-1.0, 1.0, width), np.linspace(-1.0, 1.0, height) * height / width)
        patterns: list[NDArray[np.float32]] = []
        for eye in (0, 1):
            points = (
                np.stack([x, y, np.full_like(x, 1.0 + 3.0 * eye)], axis=-1).reshape(-1, 3).astype(np.float32)
            )
            drops = 0.5 + 0.35 * noise.octaves(points, 0.25, 0, 4) - 0.2 * (x**2 + y**2).ravel()
            wiped = points * np.array([1.0, 0.45, 1.0], np.float32)
            smears = smooth_step(noise.octaves(wiped, 0.2, 60, 3), 0.45, 1.15)
            found = (np.clip(one, 0.0, 1.0).reshape(height, width) for one in (drops, smears))
            patterns.append(np.stack([one.astype(np.float32) for one in found]))
        return patterns


def _curve(start: float, events: Sequence[tuple[LensEvent, float | None]]) -> tuple[list[int], list[float]]:
    """Return times, ns, and values of a curve of straight lines through all events."""
    times, values = [0], [start]
    for event, value in sorted(events, key=lambda one: one[0].time):
        if value is not None:
            times += [event.time, event.time + event.duration + 1]
            values += [values[-1], value]
    return times, values


def _blur(picture: NDArray[np.uint8], size: int) -> NDArray[np.float32]:
    """Return a picture spread over about `size` pixels."""
    image = Image.fromarray(picture)
    return np.asarray(image.reduce(size).resize(image.size, Image.Resampling.BICUBIC), np.float32)
