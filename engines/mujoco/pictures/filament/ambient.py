"""Light from all sides: the environment that MuJoCo's Studio brings, in the colour of a place."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import mujoco
from mujoco import mjrf

from engines.mujoco.pictures.filament.upload import hold

__all__ = ["add_ambient", "tinted_environment"]

_HARMONICS = re.compile(rb"sh\0[-0-9. \n]+")
"""Key and value in the file: 9 lines of red, green and blue, the light on a matt surface by its direction."""


def add_ambient(
    context: mjrf.Context, scene: mjrf.Scene, brightness: float, colour: tuple[float, float, float]
) -> tuple[mjrf.Texture, mjrf.Light]:
    """Add light from all sides, lux, and what metal reflects.

    The renderer knows no colour of such a light, so `colour` is put into the environment itself.
    """
    file = tinted_environment(
        (Path(mujoco.__file__).parent / "studio" / "assets" / "ibl.ktx").read_bytes(), colour
    )
    texture = context.create_texture(
        mjrf.TextureConfig(
            width=len(file),
            height=0,
            format=mjrf.PixelFormat.PIXEL_FORMAT_KTX,
            sampler_type=mjrf.SamplerType.TEXTURE_CUBE,
        )
    )
    data = mjrf.TextureData()
    data.set_image(file)
    texture.upload(data)
    hold(context, data)
    light = context.create_light(
        mjrf.LightParams(type=mjrf.LightType.LIGHT_IMAGE, texture=texture, intensity=brightness)
    )
    scene.add_light(light)
    return texture, light


def tinted_environment(file: bytes, colour: Sequence[float]) -> bytes:
    """Return an environment whose light on matt surfaces has another colour; its reflections stay.

    The file is as long as before: what it holds follows at fixed places.
    """

    def tint(found: re.Match[bytes]) -> bytes:
        rows = [[float(one) for one in row.split()] for row in found[0][3:].decode().splitlines()]
        tinted = [[one * factor for one, factor in zip(row, colour, strict=True)] for row in rows]
        room = len(found[0]) - 3
        for digits in (6, 5, 4):
            text = "".join(" ".join(f"{one:.{digits}g}" for one in row) + "\n" for row in tinted).encode()
            if len(text) <= room:
                break
        return b"sh\0" + text[:-1] + b" " * (room - len(text)) + b"\n"

    return _HARMONICS.sub(tint, file, count=1)
