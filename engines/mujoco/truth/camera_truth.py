"""Truth that a camera publishes beside its pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.soft_body import SoftBody
from engines.mujoco.truth.files import instance_picture
from engines.mujoco.truth.sight import Sight
from engines.mujoco.truth.truth_scene import Instant, TruthScene
from robots.dvrk.endoscope import EYES
from schemas.message import Message
from schemas.ros import Header, Image
from schemas.vectors import Vector

__all__ = ["CameraTruth"]

_MOTIONS = "flow", "scene_flow"
"""Truth that needs two pictures."""


class CameraTruth:
    """Draws what `truth` of a camera asks for; owns an OpenGL context."""

    def __init__(self, params: EndoscopeParams, bodies: Mapping[str, SoftBody]) -> None:
        self._motions = [name for name in params.truth if name in _MOTIONS]
        self._asked = [name for name in params.truth if name not in _MOTIONS]
        self._scene = TruthScene(params, opengl.find().name, bodies)
        self._before: tuple[Instant, Header] | None = None

    def messages(self, positions: Vector, header: Header) -> Iterator[tuple[str, Message]]:
        """Yield messages by port for both eyes, with joints at `positions`, shape (nq,).

        Motion leads from the picture before to this one, and has the header of the picture before.
        """
        now = self._scene.look(positions, EYES)
        for eye, sight in now.sights.items():
            for name in self._asked:
                encoding, pixels = self._picture(name, sight)
                yield f"{eye}/{name}", _image(header, encoding, pixels)
            if self._motions and self._before is not None:
                before, stamped = self._before
                motion = self._scene.motion(before, eye, now)
                for name in self._motions:
                    encoding, pixels = (
                        ("32FC2", motion.flow) if name == "flow" else ("32FC3", motion.scene_flow)
                    )
                    yield f"{eye}/{name}", _image(stamped, encoding, pixels)
        self._before = now, header

    def _picture(self, name: str, sight: Sight) -> tuple[str, NDArray[np.float32] | NDArray[np.uint16]]:
        match name:
            case "depth":
                return "32FC1", sight.depth
            case "normals":
                return "32FC3", sight.normals
            case "segmentation":
                return "mono16", sight.classes
            case _:
                return "mono16", instance_picture(sight.bodies, self._scene.bodies)

    def close(self) -> None:
        """Free the OpenGL context. May be called twice."""
        self._scene.close()


def _image(header: Header, encoding: str, pixels: NDArray[np.float32] | NDArray[np.uint16]) -> Image:
    """Return a message for pixels of shape (height, width), or (height, width, channels)."""
    height, width = pixels.shape[:2]
    data = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder("<")).view(np.uint8).reshape(-1)
    return Image(
        header=header,
        height=height,
        width=width,
        encoding=encoding,
        step=data.size // height,
        data=data,
    )
