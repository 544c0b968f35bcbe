"""Writes rosbag2 directories (MCAP, profile ros2) for `ros2 bag play`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from shutil import rmtree
from types import TracebackType
from typing import Self

from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer, WriterError

from schemas.codec import encode, typestore
from schemas.errors import RecordingError
from schemas.message import Message

__all__ = ["BagWriter", "write_bag"]

_METADATA_VERSION = 9
"""Version of the metadata of ROS 2 Jazzy."""
_FOREVER = QosTime(9223372036, 854775807)
"""The largest duration (ns in 64 bits): rosbag2's value for no deadline, no lifespan and no lease."""


class BagWriter:
    """A bag being written; when an exception leaves the `with` block, the directory is removed."""

    def __init__(self, directory: Path) -> None:
        """Create `directory`. Raises RecordingError if the directory exists or cannot be written."""
        self.directory, self.messages = directory, 0
        self._connections: dict[str, Connection] = {}
        try:
            self._writer = _new_writer(directory)
            self._writer.open()
        except WriterError as error:
            raise RecordingError(
                f"'{directory}' exists already, and a bag overwrites nothing: name a new directory"
            ) from error
        except OSError as error:
            raise RecordingError(
                f"cannot write the bag '{directory}': {error.strerror}; name a directory that can be written"
            ) from error

    @property
    def topics(self) -> int:
        """Number of topics with at least a message."""
        return len(self._connections)

    def write(self, topic: str, type_: str, time_ns: int, payload: bytes, *, latched: bool) -> None:
        """Write a message.

        Args:
            topic: absolute name; type and quality of service are from the first message.
            type_: ROS 2 type: `sensor_msgs/msg/JointState`.
            time_ns: wall time of the message.
            payload: the message in CDR, with encapsulation header.
            latched: whether late joiners get the last message of the topic.

        Raises:
            RecordingError: if the bag cannot be written.
        """
        connection = self._connections.get(topic)
        if connection is None:
            connection = self._connections[topic] = self._writer.add_connection(
                topic,
                type_,
                typestore=typestore(),
                offered_qos_profiles=[_quality_of_service(latched=latched)],
            )
        try:
            self._writer.write(connection, time_ns, payload)
        except OSError as error:
            raise RecordingError(f"cannot write the bag '{self.directory}': {error.strerror}") from error
        self.messages += 1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self._writer.close()
        else:
            self._writer.abort()
            rmtree(self.directory, ignore_errors=True)  # without its metadata no program can read it


def write_bag(directory: str | Path, rows: Iterable[tuple[str, int, Message]]) -> None:
    """Write messages as a new rosbag2 directory (MCAP), for `scripted`, `ros-bag` and ROS tools.

        trocar.write_bag("hand", [("/pose", 0, PoseStamped()), ("/pose", 4_000_000, PoseStamped())])

    Args:
        directory: Must not exist.
        rows: Topic, time (ns) and message, oldest first. A topic keeps its type.

    Raises:
        RecordingError: The directory exists or cannot be written.
    """
    connections: dict[str, Connection] = {}
    try:
        with _new_writer(Path(directory)) as writer:
            for topic, time_ns, message in rows:
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, message.ros_type, typestore=typestore())
                writer.write(connections[topic], time_ns, encode(message))
    except WriterError as error:
        raise RecordingError(f"cannot write the bag '{directory}': {error}; name a new directory") from error
    except OSError as error:
        raise RecordingError(f"cannot write the bag '{directory}': {error.strerror}") from error


def _new_writer(directory: Path) -> Writer:
    """Return the writer of a new directory. Raises WriterError if the directory exists."""
    writer = Writer(directory, version=_METADATA_VERSION, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    return writer


def _quality_of_service(*, latched: bool) -> Qos:
    """Return the QoS of a reliable publisher: transient local if latched, else the last ten messages."""
    durability, depth = (QosDurability.TRANSIENT_LOCAL, 1) if latched else (QosDurability.VOLATILE, 10)
    return Qos(
        QosHistory.KEEP_LAST,
        depth,
        QosReliability.RELIABLE,
        durability,
        _FOREVER,
        _FOREVER,
        QosLiveliness.AUTOMATIC,
        _FOREVER,
        False,
    )
