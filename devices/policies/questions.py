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


_PATIENCE = 3
"""Observations that wait for the first pictures."""


def picture_port(camera: str) -> str:
    """Return the name of the port for the pictures of a camera."""
    return f"{camera}/image_raw"


class Questions:
    """Collects what arrives, and makes questions."""

    def __init__(self, terms: Terms) -> None:
        self._terms = terms
        self._images: dict[str, NDArray[np.uint8]] = {}
        self._misfits: dict[str, str] = {}
        """Pictures that do not fit the contract, by camera."""
        self._cameras = {picture_port(camera): camera for camera in terms.cameras}
        self.asked: PolicyObservation | None = None
        """The newest observation without a question."""

    def accept(self, port: str, message: Message) -> None:
        """Keep a message. Raises MessageError for a message that the port does not take."""
        if isinstance(message, PolicyObservation):
            self.asked = message
        elif isinstance(message, Image) and port in self._cameras:
            self._keep_picture(self._cameras[port], message)
        else:
            raise MessageError(f"port '{port}' takes no {type(message).__name__}")

    def take(self) -> tuple[PolicyObservation, Observation | str] | None:
        """Return the newest observation with its question, once; None before the first pictures.

        In place of the question: why pictures do not fit the contract, or are missing for long.
        """
        asked = self.asked
        missing = [camera for camera in self._terms.cameras if camera not in self._images]
        if asked is None or (missing and not self._misfits and asked.number <= _PATIENCE):
            return None
        self.asked = None
        if self._misfits:
            return asked, "; ".join(self._misfits.values())
        if missing:
            return asked, f"no picture of {', '.join(missing)} so far: is the camera connected to the policy?"
        images = {camera: self._images[camera] for camera in self._terms.cameras}
        return asked, Observation(
            asked.number,
            images,
            asked.state.astype(np.float32),
            self._terms.contract.instruction,
            asked.header.stamp.ns * 1e-9,
        )

    def _keep_picture(self, camera: str, message: Image) -> None:
        contract = self._terms.cameras[camera]
        shape = message.height, message.width, 3
        if message.encoding == "rgb8" and shape == (contract.height, contract.width, 3):
            self._images[camera] = np.asarray(message.data, np.uint8).reshape(shape)
            self._misfits.pop(camera, None)
            return
        self._misfits[camera] = (
            f"camera '{camera}' sends {message.width} x {message.height} {message.encoding}, the contract has"
            f" {contract.width} x {contract.height} rgb8"
        )
