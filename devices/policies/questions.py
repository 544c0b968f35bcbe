"""Questions to a policy: readings and the newest picture of every camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from devices.policies.policy import Observation
from robots.policies.terms import Terms
from schemas.errors import MessageError
from schemas.message import Message
from schemas.ros import Image
from schemas.trocar_msgs import PolicyObservation

__all__ = ["Questions", "picture_port"]


def picture_port(camera: str) -> str:
    """Return the name of the port for the pictures of a camera."""
    return f"{camera}/image_raw"


class Questions:
    """Collects what arrives, and makes questions."""

    def __init__(self, terms: Terms) -> None:
        self._terms = terms
        self._images: dict[str, NDArray[np.uint8]] = {}
        self._cameras = {picture_port(camera): camera for camera in terms.cameras}
        self.asked: PolicyObservation | None = None
        """The newest observation without a question."""

    def accept(self, port: str, message: Message) -> None:
        """Keep a message. Raises MessageError for a picture with another size than the contract has."""
        if isinstance(message, PolicyObservation):
            self.asked = message
        elif isinstance(message, Image) and port in self._cameras:
            camera = self._cameras[port]
            self._images[camera] = self._pixels(camera, message)
        else:
            raise MessageError(f"port '{port}' takes no {type(message).__name__}")

    def take(self) -> tuple[PolicyObservation, Observation] | None:
        """Return the newest observation and its question, once; None before the first picture."""
        asked = self.asked
        if asked is None or len(self._images) < len(self._cameras):
            return None
        self.asked = None
        images = {camera: self._images[camera] for camera in self._terms.cameras}
        return asked, Observation(
            asked.number,
            images,
            asked.state.astype(np.float32),
            self._terms.contract.instruction,
            asked.header.stamp.ns * 1e-9,
        )

    def _pixels(self, camera: str, message: Image) -> NDArray[np.uint8]:
        contract = self._terms.cameras[camera]
        shape = message.height, message.width, 3
        if message.encoding != "rgb8" or shape != (contract.height, contract.width, 3):
            raise MessageError(
                f"camera '{camera}' sends {message.width} x {message.height} {message.encoding}, the contract"
                f" has {contract.width} x {contract.height} rgb8"
            )
        return np.asarray(message.data, np.uint8).reshape(shape)
