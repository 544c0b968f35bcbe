"""The scene of a page: the soft surfaces of a tissue engine, and their colours."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from engines.tissue.params import PressedOrgansParams
from hub.participant.view import Camera, Frame, Part, Rgb
from schemas.vectors import Vector

__all__ = ["ViewScene"]

_COLOURS: dict[str, Rgb] = {
    "adrenal": (0.83, 0.60, 0.28),
    "colon": (0.86, 0.55, 0.48),
    "fat": (0.90, 0.76, 0.42),
    "kidney": (0.60, 0.24, 0.20),
    "liver": (0.52, 0.20, 0.15),
}
"""Colours of the endoscope's skins by the last word of an organ's name."""
_TISSUE: Rgb = (0.80, 0.38, 0.33)


class ViewScene:
    """The organs; nothing else of the tissue engine is published."""

    bodies: tuple[str, ...] = ()
    parts: tuple[Part, ...] = ()
    frames: tuple[Frame, ...] = ()
    cameras: tuple[Camera, ...] = ()
    inputs: tuple[str, ...] = ()

    def __init__(self, params: PressedOrgansParams) -> None:
        self.surfaces: dict[str, Rgb] = {
            f"{name}/nodes": _COLOURS.get(next(filter(name.endswith, _COLOURS), ""), _TISSUE)
            for name in params.organs
        }

    def poses(self, values: Mapping[str, Vector]) -> NDArray[np.float32]:  # noqa: ARG002
        """Return no poses, shape (0, 7): there are no rigid bodies to show."""
        return np.zeros((0, 7), np.float32)
