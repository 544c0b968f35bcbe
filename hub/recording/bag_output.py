"""Writes rows of messages as a rosbag2 directory: samples for the devices that play a recording."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from rosbags.interfaces import Connection
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer, WriterError

from schemas.codec import encode, typestore
from schemas.errors import RecordingError
from schemas.message import Message

__all__ = ["write_bag"]

_METADATA_VERSION = 9
"""As ROS 2 Jazzy writes it."""


def write_bag(directory: str | Path, rows: Iterable[tuple[str, int, Message]]) -> None:
    """Write messages as a new rosbag2 directory (MCAP), which `scripted`, `ros-bag` and ROS tools play.

        trocar.write_bag("hand", [("/pose", 0, PoseStamped()), ("/pose", 4_000_000, PoseStamped())])

    Args:
        directory: It must not exist.
        rows: Topic, time (ns) and message, oldest first. Topics keep one type.

    Raises:
        RecordingError: The directory exists or cannot be written.
    """
    connections: dict[str, Connection] = {}
    try:
        writer = Writer(Path(directory), version=_METADATA_VERSION, storage_plugin=StoragePlugin.MCAP)
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with writer:
            for topic, time_ns, message in rows:
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, message.ros_type, typestore=typestore())
                writer.write(connections[topic], time_ns, encode(message))
    except WriterError as error:
        raise RecordingError(f"cannot write the bag '{directory}': {error}; name a new directory") from error
    except OSError as error:
        raise RecordingError(f"cannot write the bag '{directory}': {error.strerror}") from error
