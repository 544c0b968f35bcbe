"""Lens and sensor after a picture is drawn: loss of light, white balance, noise, a video link."""

from __future__ import annotations

from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from engines.mujoco.pictures.filament.lens_cover import LensCover
from engines.mujoco.pictures.sensor_params import SensorParams

try:
    from engines.mujoco.pictures.filament import _exposure as compiled
except ImportError:  # there was no compiler: the same pictures, more slowly
    compiled = None

__all__ = ["Sensor", "expose_by_arrays"]

_SHOT, _READ = 0.03, 0.7
"""Variance of shot noise for each grey level, and standard deviation of read noise, grey levels of 255.

No figures of a surgical camera are published: chosen by eye, so that grain is hardly seen.
"""
_DARK = _READ**2 / _SHOT
"""Grey levels whose shot noise is the read noise."""
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
        x, y = np.linspace(-1.0, 1.0, width), np.linspace(-1.0, 1.0, height)[:, None]
        corner = 0.5 * (x**2 + y**2)
        vignette = (1.0 - params.vignette * corner**1.5)[..., None]
        warmth = np.array([2.0 ** (0.5 * params.warmth), 1.0, 2.0 ** (-0.5 * params.warmth)])
        self._light = np.ascontiguousarray(np.broadcast_to(vignette * warmth, (height, width, 3)), np.float32)
        self._gains = np.ones(3, np.float32)
        self._balances = params.white_balance == "automatic"
        self._pool: NDArray[np.float32] | None = None
        if params.noise:
            pool = np.random.default_rng(0).standard_normal(self._light.size + _SHIFTS, np.float32)
            self._pool = pool * np.float32(params.noise * _SHOT**0.5)
        self._is_plain = not (params.vignette or params.noise or params.warmth or self._balances)

    def expose(self, picture: NDArray[np.uint8], time_ns: int, eye: int) -> NDArray[np.uint8]:
        """Return a picture, shape (height, width, 3), RGB, as the sensor delivers it.

        The noise is the same for the same time and eye, so that a picture can be drawn again.
        """
        covered = self._cover.cover(picture, time_ns, eye)
        found = covered.copy() if self._is_plain else self._sensed(covered, time_ns, eye)
        return found if self._params.compression is None else _send(found, self._params.compression)

    def _sensed(self, picture: NDArray[np.uint8], time_ns: int, eye: int) -> NDArray[np.uint8]:
        """Return a picture with balance, vignette and noise."""
        if self._balances and eye == 0:
            self._balance(picture[::4, ::4] * self._light[::4, ::4])
        noise = None
        if self._pool is not None:
            start = ((time_ns // 1000 * 2 + eye) * _MIXER % (1 << 64)) >> 48
            noise = self._pool[start : start + self._light.size].reshape(self._light.shape)
        found = np.empty(self._light.shape, np.uint8)
        _expose(picture, self._light, np.tile(self._gains, self._light.shape[1]), noise, _DARK, found)
        return found

    def _balance(self, grey: NDArray[np.float32]) -> None:
        """Move the gains towards those with which the mean of a picture is nearly grey."""
        mean = np.maximum(grey.mean(axis=(0, 1)), 1.0)
        wanted = (mean[1] / mean) ** np.float32(_BALANCE)
        self._gains += np.float32(_BALANCE_LAG) * (wanted - self._gains)


def expose_by_arrays(
    picture: NDArray[np.uint8],
    light: NDArray[np.float32],
    gains: NDArray[np.float32],
    noise: NDArray[np.float32] | None,
    dark: float,
    found: NDArray[np.uint8],
) -> None:
    """Write into `found` what `_exposure.c` writes, without a compiler."""
    grey = picture * light
    grey *= gains.reshape(-1, 3)
    if noise is None:
        grey += np.float32(0.5)
    else:
        grey += np.float32(dark)
        grey += np.sqrt(grey) * noise
        grey -= np.float32(dark) - np.float32(0.5)
    found[:] = np.clip(grey, 0.0, 255.0, out=grey)


_expose = expose_by_arrays if compiled is None else compiled.expose


def _send(picture: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    """Return a picture after a JPEG with half the resolution of colour, as of a video link."""
    file = BytesIO()
    Image.fromarray(picture).save(file, "jpeg", quality=quality, subsampling="4:2:0")
    file.seek(0)
    return np.asarray(Image.open(file).convert("RGB"))
