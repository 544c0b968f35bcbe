"""Lens and sensor after a picture is drawn: loss of light, white balance, noise, a video link."""

from __future__ import annotations

from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from engines.mujoco.pictures.filament.lens_cover import LensCover
from engines.mujoco.pictures.sensor_params import SensorParams

__all__ = ["Sensor"]

_SHOT, _READ = 0.03, 0.7
"""Variance of shot noise for each grey level, and standard deviation of read noise, grey levels of 255.

No figures of a surgical camera are published: chosen by eye, so that grain is hardly seen.
"""
_SHIFTS = 1 << 16
"""Places in the kept numbers of noise from which a picture may take its numbers."""
_MIXER = 0x9E3779B97F4A7C15
"""Odd number that spreads times over those places."""
_BALANCE, _BALANCE_LAG = 0.6, 0.1
"""Share of a cast that automatic white balance removes, and the share of the way for each picture."""


class Sensor:
    """What happens to the pictures of both eyes."""

    def __init__(self, params: SensorParams, width: int, height: int) -> None:
        self._params, self._cover = params, LensCover(params, width, height)
        self._noise = np.float32(params.noise)
        x, y = np.linspace(-1.0, 1.0, width), np.linspace(-1.0, 1.0, height)[:, None]
        corner = 0.5 * (x**2 + y**2)
        vignette = (1.0 - params.vignette * corner**1.5)[..., None]
        warmth = np.array([2.0 ** (0.5 * params.warmth), 1.0, 2.0 ** (-0.5 * params.warmth)])
        self._light = np.ascontiguousarray(np.broadcast_to(vignette * warmth, (height, width, 3)), np.float32)
        self._gains = np.ones(3, np.float32)
        self._grey, self._deviation = np.zeros_like(self._light), np.zeros_like(self._light)
        self._pool = np.random.default_rng(0).standard_normal(
            self._light.size + _SHIFTS if params.noise else 0, np.float32
        )
        self._is_plain = (
            not params.vignette and not params.noise and not params.warmth and params.white_balance == "fixed"
        )

    def expose(self, picture: NDArray[np.uint8], time_ns: int, eye: int) -> NDArray[np.uint8]:
        """Return a picture, shape (height, width, 3), RGB, as the sensor delivers it.

        The noise is the same for the same time and eye, so that a picture can be drawn again.
        """
        covered = self._cover.cover(picture, time_ns, eye)
        found = covered.copy() if self._is_plain else self._sensed(covered, time_ns, eye)
        return found if self._params.compression is None else _send(found, self._params.compression)

    def _sensed(self, picture: NDArray[np.uint8], time_ns: int, eye: int) -> NDArray[np.uint8]:
        """Return a picture with balance, vignette and noise.

        Arrays are written in place: a picture has millions of numbers, and a GPU draws faster than they are
        allocated.
        """
        grey, deviation = self._grey, self._deviation
        np.multiply(picture, self._light, out=grey)
        if self._params.white_balance == "automatic":
            if eye == 0:
                self._balance(grey)
            grey *= self._gains
        if self._noise:
            np.multiply(grey, np.float32(_SHOT), out=deviation)
            deviation += np.float32(_READ**2)
            np.sqrt(deviation, out=deviation)
            start = ((time_ns // 1000 * 2 + eye) * _MIXER % (1 << 64)) >> 48
            deviation *= self._pool[start : start + grey.size].reshape(grey.shape)
            deviation *= self._noise
            grey += deviation
        grey += np.float32(0.5)
        np.clip(grey, 0.0, 255.0, out=grey)
        return grey.astype(np.uint8)

    def _balance(self, grey: NDArray[np.float32]) -> None:
        """Move the gains towards those with which the mean of a picture is nearly grey."""
        mean = np.maximum(grey[::4, ::4].mean(axis=(0, 1)), 1.0)
        wanted = (mean[1] / mean) ** np.float32(_BALANCE)
        self._gains += np.float32(_BALANCE_LAG) * (wanted - self._gains)


def _send(picture: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    """Return a picture after a JPEG with half the resolution of colour, as of a video link."""
    file = BytesIO()
    Image.fromarray(picture).save(file, "jpeg", quality=quality, subsampling="4:2:0")
    file.seek(0)
    return np.asarray(Image.open(file).convert("RGB"))
