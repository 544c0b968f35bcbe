"""The scene of a page: the surfaces of a participant of kind suture-pad, and their colours."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from engines.suture_pad.ports import SKIN
from hub.participant import Params
from hub.participant.view import Camera, Frame, Part, Rgb
from robots.training.threads import THREAD
from schemas.vectors import Vector

__all__ = ["ViewScene"]


class ViewScene:
    """Skin and thread, in the colours of the endoscope's skins."""

    bodies: tuple[str, ...] = ()
    parts: tuple[Part, ...] = ()
    frames: tuple[Frame, ...] = ()
    cameras: tuple[Camera, ...] = ()
    inputs: tuple[str, ...] = ()
    surfaces: Mapping[str, Rgb] = {
        f"{SKIN}/nodes": (0.80, 0.38, 0.33),
        f"{THREAD}/nodes": (0.35, 0.1, 0.55),
    }

    def __init__(self, params: Params) -> None:
        """Every pad looks the same."""

    def poses(self, values: Mapping[str, Vector]) -> NDArray[np.float32]:  # noqa: ARG002
        """Return no poses, shape (0, 7): there are no rigid bodies to show."""
        return np.zeros((0, 7), np.float32)
