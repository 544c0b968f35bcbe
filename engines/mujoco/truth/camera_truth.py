"""Truth that a camera publishes beside its pictures."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.soft_body import SoftBody
from engines.mujoco.truth.files import instance_picture, instruments_json
from engines.mujoco.truth.sight import Motion, Sight
from engines.mujoco.truth.truth_scene import Instant, TruthScene
from robots.dvrk.endoscope import EYES
from schemas.crtk import StringStamped
from schemas.message import Message
from schemas.ros import Header, Image
from schemas.vectors import Vector

__all__ = ["CameraTruth"]

_MOTIONS = "flow", "scene_flow", "occlusion"
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
                yield f"{eye}/{name}", self._message(name, sight, header)
            if self._motions and self._before is not None:
                before, stamped = self._before
                motion = self._scene.motion(before, eye, now)
                for name in self._motions:
                    yield f"{eye}/{name}", _motion_message(name, before.sights[eye], motion, stamped)
        self._before = now, header

    def _message(self, name: str, sight: Sight, header: Header) -> Message:
        match name:
            case "depth":
                return _image(header, "32FC1", sight.depth)
            case "normals":
                return _image(header, "32FC3", sight.normals)
            case "segmentation":
                return _image(header, "mono16", sight.classes)
            case "keypoints":
                views = self._scene.instrument_views(sight)
                return StringStamped(
                    header=header, string=json.dumps(instruments_json(views, keypoints=True))
                )
            case _:
                return _image(header, "mono16", instance_picture(sight.bodies, self._scene.bodies))

    def close(self) -> None:
        """Free the OpenGL context. May be called twice."""
        self._scene.close()


def _motion_message(name: str, sight: Sight, motion: Motion, header: Header) -> Image:
    """Return a message about the points that `sight` shows."""
    match name:
        case "flow":
            return _image(header, "32FC2", motion.flow)
        case "scene_flow":
            return _image(header, "32FC3", motion.scene_flow)
        case _:
            return _image(header, "mono8", np.uint8(255) * (sight.hit & ~motion.is_visible))


def _image(
    header: Header, encoding: str, pixels: NDArray[np.float32] | NDArray[np.uint16] | NDArray[np.uint8]
) -> Image:
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
