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
_SHIFTS = 1 << 16
"""Places in the kept numbers of noise from which a picture may take its numbers."""


class Sensor:
    """What happens to the pictures of both eyes."""

    def __init__(self, params: SensorParams, width: int, height: int) -> None:
        self._noise = np.float32(params.noise)
        self._random = np.random.default_rng(0)
        x, y = np.linspace(-1.0, 1.0, width), np.linspace(-1.0, 1.0, height)[:, None]
        corner = 0.5 * (x**2 + y**2)
        vignette = (1.0 - params.vignette * corner**1.5)[..., None]
        self._light = np.ascontiguousarray(np.broadcast_to(vignette, (height, width, 3)), np.float32)
        self._grey, self._deviation = np.zeros_like(self._light), np.zeros_like(self._light)
        self._pool = self._random.standard_normal(
            self._light.size + _SHIFTS if params.noise else 0, np.float32
        )
        self._is_plain = not params.vignette and not params.noise

    def expose(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return a picture, shape (height, width, 3), RGB, as the sensor delivers it.

        Arrays are written in place: a picture has millions of numbers, and a GPU draws faster than they are
        allocated.
        """
        if self._is_plain:
            return picture.copy()
        grey, deviation = self._grey, self._deviation
        np.multiply(picture, self._light, out=grey)
        if self._noise:
            np.multiply(grey, np.float32(_SHOT), out=deviation)
            deviation += np.float32(_READ**2)
            np.sqrt(deviation, out=deviation)
            start = int(self._random.integers(_SHIFTS))
            deviation *= self._pool[start : start + grey.size].reshape(grey.shape)
            deviation *= self._noise
            grey += deviation
        grey += np.float32(0.5)
        np.clip(grey, 0.0, 255.0, out=grey)
        return grey.astype(np.uint8)
