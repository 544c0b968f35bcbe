"""Stereo pictures of a recording at the frames of an episode: recorded, else drawn."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from engines.mujoco.pictures.recorded_scene import RecordedScene
from schemas.codec import decode
from schemas.errors import MessageError, RecordingError
from trocar import Recording
from trocar.messages import CompressedImage, Image

__all__ = ["DEFAULT_SIZE", "EYES", "Pair", "Stereo", "recorded_instants", "recorded_size", "stereo"]

EYES = ("left", "right")
DEFAULT_SIZE = (640, 480)
"""Size of drawn pictures where none are recorded: the SD camera of the dVRK Classic (decision 13)."""
_NS = 1_000_000_000
_NEVER_NS = -(2**62)

Pair = tuple[NDArray[np.uint8], NDArray[np.uint8]]
"""Left and right picture, shape (height, width, 3), RGB."""


@dataclass(frozen=True)
class Stereo:
    """The pictures of an episode."""

    count: int
    """Frames with pictures: all, or all but the last, if a camera has not delivered at the end."""
    recorded: bool
    """Whether the session recorded the pictures; else the session's states are drawn."""
    pairs: Iterator[Pair]


def stereo(
    recording: Recording,
    times_ns: NDArray[np.int64],
    fps: int,
    size: tuple[int, int],
    *,
    looks: Literal["plain", "endoscope"] | None = None,
    randomise: int | None = None,
    trust: bool = False,
) -> Stereo:
    """Return the pictures at `times_ns`, shape (n,), recorded or drawn.

    Recorded pictures are used if no `looks` are asked for, the size is right and each frame has its own
    picture. `randomise`: seed of drawn looks. `trust` allows a drawn scene of changed files. Raises
    RecordingError if there is nothing to draw, TrustError for changed files, TrocarError without OpenGL; so
    may the pictures.
    """
    ports = () if looks else _ports(recording)
    if ports and recorded_size(recording) == size:
        picked = [_newest(recording, port, times_ns) for port in ports]
        # its own picture: taken after the frame before
        fits = np.logical_and.reduce([times_ns - taken_ns < _NS / fps for taken_ns in picked])
        count = len(times_ns) if fits.all() else int(fits.argmin())
        if count >= len(times_ns) - 1:
            eyes = (
                _recorded_pictures(recording, port, taken[:count], size)
                for port, taken in zip(ports, picked, strict=True)
            )
            return Stereo(count, recorded=True, pairs=zip(*eyes, strict=True))
    scene = RecordedScene(recording, looks=looks or "plain", randomise=randomise, trust=trust)
    return Stereo(len(times_ns), recorded=False, pairs=scene.stereo(times_ns.tolist(), size))


def recorded_size(recording: Recording) -> tuple[int, int] | None:
    """Return width and height of the endoscope's first picture; None if none is recorded."""
    for port in _ports(recording):
        for _, pixels in _pictures(recording, port):
            return pixels.shape[1], pixels.shape[0]
    return None


def recorded_instants(recording: Recording) -> NDArray[np.int64]:
    """Return simulated times of each recorded stereo pair, ns, shape (n, 3); empty if none is recorded.

    Of a pair: when it was taken, and when the left and the right picture arrived.
    """
    arrivals: list[dict[int, int]] = []
    for port in _ports(recording):
        messages = recording.messages(recording[port].topic)
        arrivals.append(
            {
                _decode_picture(recording, one.topic, one.type, one.payload).header.stamp.ns: one.time_ns
                for one in messages
            }
        )
    if not arrivals:
        return np.empty((0, 3), np.int64)
    left, right = arrivals
    return np.array([(taken, left[taken], right[taken]) for taken in sorted(left.keys() & right)], np.int64)


def _ports(recording: Recording) -> tuple[str, ...]:
    """Return the ports with the pictures of both eyes; empty if not recorded.

    The ECM's tip is preferred, and uncompressed pictures if recorded both ways.
    """
    participants = recording.scenario().participants
    cameras = [(name, spec.params) for name, spec in participants.items() if spec.kind == "endoscope"]
    for name, _ in sorted(cameras, key=lambda camera: "view" in camera[1]):
        for port in ("image_raw", "image_raw/compressed"):
            ports = tuple(f"{name}.{eye}/{port}" for eye in EYES)
            if all(one in recording and len(recording[one]) for one in ports):
                return ports
    return ()


def _newest(recording: Recording, port: str, times_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return when the newest picture up to each time was taken; far in the past if there is none."""
    taken = (
        _decode_picture(recording, message.topic, message.type, message.payload).header.stamp.ns
        for message in recording.messages(recording[port].topic)
    )
    taken_ns = np.array([_NEVER_NS, *taken], np.int64)
    return taken_ns[np.searchsorted(taken_ns, times_ns, side="right") - 1]


def _recorded_pictures(
    recording: Recording, port: str, taken_ns: NDArray[np.int64], size: tuple[int, int]
) -> Iterator[NDArray[np.uint8]]:
    """Yield the pictures taken at `taken_ns`, each once."""
    wanted = iter(taken_ns.tolist())
    next_ns = next(wanted, None)
    for stamp_ns, pixels in _pictures(recording, port):
        if next_ns is None:
            return
        if stamp_ns != next_ns:
            continue
        if pixels.shape != (size[1], size[0], 3):
            raise RecordingError(
                f"'{recording.file}': '{port}' has pictures of {size[0]} x {size[1]} pixels, but one of"
                f" {pixels.shape[1]} x {pixels.shape[0]}"
            )
        yield pixels
        next_ns = next(wanted, None)


def _pictures(recording: Recording, port: str) -> Iterator[tuple[int, NDArray[np.uint8]]]:
    """Yield when each picture was taken (ns), and the picture."""
    for message in recording.messages(recording[port].topic):
        picture = _decode_picture(recording, message.topic, message.type, message.payload)
        try:
            pixels = _picture_pixels(picture)
        except (OSError, ValueError) as error:
            raise RecordingError(f"'{recording.file}': '{port}' has a damaged picture: {error}") from error
        yield picture.header.stamp.ns, pixels


def _decode_picture(
    recording: Recording, topic: str, type_name: str, payload: bytes
) -> Image | CompressedImage:
    try:
        return decode(Image if type_name == Image.ros_type else CompressedImage, payload)
    except MessageError as error:
        raise RecordingError(f"'{recording.file}': topic '{topic}': {error}") from error


def _picture_pixels(picture: Image | CompressedImage) -> NDArray[np.uint8]:
    """Return a picture, shape (height, width, 3), RGB. Raises OSError or ValueError if damaged."""
    if isinstance(picture, Image):
        if picture.encoding != "rgb8":
            raise ValueError(f"encoding '{picture.encoding}', expected 'rgb8'")
        return picture.data.reshape(picture.height, picture.width, 3)
    from PIL import Image as Picture

    with Picture.open(BytesIO(picture.data.tobytes()), formats=("JPEG", "PNG")) as file:
        return np.asarray(file.convert("RGB"))
