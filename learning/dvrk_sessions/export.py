"""Writes a recording as a session of dvrk_data: a ROS bag, and a video for each eye.

DIR/index.json           videos and the bag
DIR/left.mp4, right.mp4  pictures of the endoscope, H.264
DIR/left.json, right.json  times of all frames
DIR/rosbag/              messages under the dVRK's names, without pictures
DIR/session_tags.json    the session as a stage, and events of its tasks
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.ros.bags.export import export as write_bag
from hub.recording.dvrk_session import BAG, INDEX
from learning.datasets.pictures import DEFAULT_SIZE, EYES, Stereo, recorded_instants, recorded_size, stereo
from learning.datasets.video import H264, Video
from learning.dvrk_sessions.documents import Frame, Tag, index, session_tags, video_sidecar
from schemas.codec import decode
from schemas.errors import RecordingError
from schemas.trocar_msgs import TaskEvent
from trocar import Recording

__all__ = ["Exported", "Pictures", "export_session"]

_NS = 1_000_000_000


@dataclass(frozen=True)
class Pictures:
    """Pictures that a session without recorded ones gets."""

    fps: int = 30
    size: tuple[int, int] = DEFAULT_SIZE
    """Width and height, pixels."""


@dataclass(frozen=True)
class Exported:
    """Summary of an export."""

    session: str
    frames: int
    """Frames of each eye."""
    pictures: str
    """`recorded` or `drawn`."""
    topics: int
    messages: int
    duration_s: float


def export_session(
    recording: Recording,
    directory: Path,
    gateway: str | None = None,
    drawn: Pictures = Pictures(),
    *,
    trust: bool = False,
) -> Exported:
    """Write `recording` into the empty `directory`.

    Args:
        recording: of a session.
        directory: empty.
        gateway: name of the gateway whose topics are written, where a session has several.
        drawn: how pictures are drawn if none are recorded.
        trust: allow demands refused by `trusted_parameters`.

    Raises RecordingError, TrustError and ScenarioError as `trocar ros bag` and drawing do.
    """
    bag = write_bag(recording, directory / BAG, gateway, pictures=False, trust=trust)
    times_ns, size, fps = _frame_times(recording, drawn)
    pictures = stereo(recording, times_ns[:, 0], fps, size, trust=trust)
    count = _write_videos(directory, pictures, times_ns, size, fps)
    start_ns, frames = recording.started_ns(), _frames(times_ns[:count])
    _write_json(directory / INDEX, index(frames))
    for eye, its_frames in frames.items():
        _write_json(directory / f"{eye}.json", video_sidecar(eye, its_frames, start_ns))
    tags = session_tags(recording.scenario().name, recording.duration_ns, _tags(recording), start_ns)
    _write_json(directory / "session_tags.json", tags)
    source = "recorded" if pictures.recorded else "drawn"
    return Exported(str(directory), count, source, bag.topics, bag.messages, bag.duration_s)


def _frame_times(recording: Recording, drawn: Pictures) -> tuple[NDArray[np.int64], tuple[int, int], int]:
    """Return when pairs were taken and arrived, shape (n, 3), their size, and frames of a second."""
    times_ns, size = recorded_instants(recording), recorded_size(recording)
    if len(times_ns) > 1 and size is not None:
        if size[0] % 2 or size[1] % 2:
            raise RecordingError(
                f"'{recording.file}' has pictures of {size[0]} x {size[1]} pixels; H.264 takes even numbers"
            )
        return times_ns, size, max(1, round(_NS / float(np.median(np.diff(times_ns[:, 0])))))
    count = max(1, recording.duration_ns * drawn.fps // _NS)
    taken_ns = np.arange(count, dtype=np.int64) * _NS // drawn.fps
    return np.repeat(taken_ns[:, None], 3, axis=1), drawn.size, drawn.fps


def _write_videos(
    directory: Path, pictures: Stereo, times_ns: NDArray[np.int64], size: tuple[int, int], fps: int
) -> int:
    """Write both videos; return the number of frames."""
    taken_ns: list[int] = times_ns[: pictures.count, 0].tolist()
    with ExitStack() as stack:
        videos = [
            stack.enter_context(closing(Video(directory / f"{eye}.mp4", size, fps, H264))) for eye in EYES
        ]
        for time_ns, pair in zip(taken_ns, pictures.pairs, strict=True):
            for video, picture in zip(videos, pair, strict=True):
                video.add(picture, round((time_ns - taken_ns[0]) * H264.ticks / _NS))
        return videos[0].frames


def _frames(times_ns: NDArray[np.int64]) -> Mapping[str, Sequence[Frame]]:
    return {eye: [Frame(row[0], row[i]) for row in times_ns.tolist()] for i, eye in enumerate(EYES, start=1)}


def _tags(recording: Recording) -> Iterator[Tag]:
    """Yield the events of all tasks."""
    for port, type_name in recording.ports.items():
        if type_name == TaskEvent.ros_type:
            for message in recording.messages(recording[port].topic):
                event = decode(TaskEvent, message.payload)
                yield Tag(event.event, event.header.stamp.ns)


def _write_json(file: Path, document: Mapping[str, Any]) -> None:
    file.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
