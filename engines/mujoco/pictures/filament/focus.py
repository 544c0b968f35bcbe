"""Depth of field: blur of surfaces nearer or farther than the distance in focus.

The renderer has a depth of field of its own, and no caller can switch it on.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mujoco import mjrf
from numpy.typing import NDArray
from PIL import Image, ImageFilter

from robots.dvrk.endoscope import StereoCamera

__all__ = ["Focus", "blur"]

_WIDEST = 16.0
"""Largest standard deviation of a blur, px; a level is half as wide as the next."""
_DISC = 0.25
"""Standard deviation of an even disc over its diameter."""


class Focus:
    """Draws the depth of both pictures and blurs them by it."""

    def __init__(
        self,
        context: mjrf.Context,
        camera: StereoCamera,
        clip: tuple[float, float],
        focus_m: float,
        aperture_m: float,
    ) -> None:
        """`aperture_m`: diameter of the lens's opening."""
        self._context, self._size = context, (camera.width, camera.height)
        near, self._far = clip
        self._share = (self._far - near) / near
        self._sharp = 1.0 / focus_m
        self._gain = _DISC * aperture_m * camera.focal_length
        self._depth = np.zeros((camera.height, 2 * camera.width), np.float32)
        self._target = context.create_render_target(
            mjrf.RenderTargetConfig(
                width=2 * camera.width,
                height=camera.height,
                color_format=mjrf.PixelFormat.PIXEL_FORMAT_R32F,
                depth_format=mjrf.PixelFormat.PIXEL_FORMAT_DEPTH32F,
            )
        )
        self._read = mjrf.ReadRequest(target=self._target)
        self._read.set_buffer(self._depth)

    def measure(self, scene: mjrf.Scene, eyes: Sequence[mjrf.Camera]) -> None:
        """Draw the depth that the left and the right camera see."""
        width, height = self._size
        requests = [
            mjrf.RenderRequest(
                scene=scene,
                camera=camera,
                viewport=mjrf.Rect(left=eye * width, bottom=0, width=width, height=height),
                target=self._target,
                draw_mode=mjrf.DrawMode.DRAW_MODE_DEPTH,
                post_processing=False,
            )
            for eye, camera in enumerate(eyes)
        ]
        self._context.wait_for_frame(self._context.render(requests, [self._read]))

    def blur(self, picture: NDArray[np.uint8], eye: int) -> NDArray[np.uint8]:
        """Return the picture of an eye, shape (height, width, 3), as the lens shows it."""
        width, _ = self._size
        depth = self._depth[:, eye * width : (eye + 1) * width]
        # the renderer keeps near / (far - near) * (far / z - 1)
        nearness = (depth * np.float32(self._share) + np.float32(1.0)) / np.float32(self._far)
        return blur(picture, np.float32(self._gain) * (nearness - np.float32(self._sharp)))


def blur(picture: NDArray[np.uint8], widths: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return a blurred picture.

    Args:
        picture: shape (height, width, 3).
        widths: standard deviation of the blur of each pixel, px, shape (height, width); negative behind the
            distance in focus. What is before it is blurred over the sharp pixels around.
    """
    spread = np.minimum(np.maximum(np.abs(widths), _over_its_edge(widths)), _WIDEST)
    # level 0 is sharp, level 1 has a width of one pixel, each further one twice the width
    levels = np.where(spread < 1.0, spread, 1.0 + np.log2(np.maximum(spread, 1.0)))[..., None]
    image = Image.fromarray(np.ascontiguousarray(picture))
    found = np.maximum(1.0 - levels, 0.0) * picture
    for level in range(1, int(np.ceil(levels.max())) + 1):
        blurred = np.asarray(image.filter(ImageFilter.GaussianBlur(2.0 ** (level - 1))), np.float32)
        found += np.maximum(1.0 - np.abs(levels - level), 0.0) * blurred
    return (found + np.float32(0.5)).astype(np.uint8)


def _over_its_edge(widths: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the widths of near surfaces, spread over their edges."""
    most = float(widths.max(initial=0.0))
    if most < 0.5:
        return np.zeros_like(widths)
    scale = 255.0 / min(most, _WIDEST)
    near = Image.fromarray(np.clip(scale * widths, 0.0, 255.0).astype(np.uint8))
    spread = near.filter(ImageFilter.GaussianBlur(min(most, _WIDEST)))
    return np.asarray(spread, np.float32) / np.float32(scale)
