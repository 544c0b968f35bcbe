"""Loss of light towards the corners, and noise, after a picture is drawn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engines.mujoco.pictures.sensor_params import SensorParams

__all__ = ["Sensor"]

_SHOT, _READ = 0.03, 0.7
"""Variance of shot noise for each grey level, and standard deviation of read noise, grey levels of 255.

No figures of a surgical camera are published: chosen by eye, so that grain is hardly seen.
"""
_POOL = 1 << 20
"""Numbers of noise kept; each picture takes them from another place."""


class Sensor:
    """What happens to the pictures of both eyes."""

    def __init__(self, params: SensorParams, width: int, height: int) -> None:
        self._noise = np.float32(params.noise)
        self._random = np.random.default_rng(0)
        x, y = np.linspace(-1.0, 1.0, width), np.linspace(-1.0, 1.0, height)[:, None]
        corner = 0.5 * (x**2 + y**2)
        self._light = (1.0 - params.vignette * corner**1.5)[..., None].astype(np.float32)
        self._pool = self._random.standard_normal(_POOL if params.noise else 0, np.float32)
        self._is_plain = not params.vignette and not params.noise

    def expose(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return a picture, shape (height, width, 3), RGB, as the sensor delivers it."""
        if self._is_plain:
            return picture.copy()
        light = picture * self._light
        if self._noise:
            deviation = self._noise * np.sqrt(np.float32(_SHOT) * light + np.float32(_READ**2))
            start = int(self._random.integers(_POOL))
            numbers = np.take(self._pool, np.arange(start, start + light.size), mode="wrap")
            light += deviation * numbers.reshape(light.shape)
        return np.clip(light + np.float32(0.5), 0.0, 255.0).astype(np.uint8)
