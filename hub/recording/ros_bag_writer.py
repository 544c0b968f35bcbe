"""Writes a rosbag2 directory (MCAP, profile ros2) of what a gateway publishes and hears, with the quality of
service that it offers.
"""

from __future__ import annotations

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

from devices.ros.topics.row import Row
from devices.ros.topics.stamps import stamped
from schemas.codec import encode, typestore
from schemas.errors import RecordingError
from schemas.message import Message

__all__ = ["BagWriter"]

_METADATA_VERSION = 9
"""As ROS 2 Jazzy writes it."""
_FOREVER = QosTime(9223372036, 854775807)
"""The largest duration (ns in 64 bits): what rosbag2 notes of a publisher without deadline, lifespan and
lease.
"""


class BagWriter:
    """A bag that is being written; times are simulated and become those of the wall clock."""

    def __init__(self, directory: Path, start_ns: int) -> None:
        """Create `directory`; `start_ns`: wall time of simulated time 0.

        Raises RecordingError if it exists or cannot be written.
        """
        self.directory, self.messages = directory, 0
        self._start_ns = start_ns
        self._connections: dict[str, Connection] = {}
        self._stamps: dict[str, int] = {}
        try:
            self._writer = Writer(directory, version=_METADATA_VERSION, storage_plugin=StoragePlugin.MCAP)
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
        except WriterError as error:
            raise RecordingError(
                f"'{directory}' is there already, and a bag overwrites nothing: name a new directory"
            ) from error
        except OSError as error:
            raise RecordingError(
                f"cannot write the bag '{directory}': {error.strerror}; name a directory that can be written"
            ) from error

    @property
    def topics(self) -> int:
        """Topics with at least one message."""
        return len(self._connections)

    def stamp_ns(self, row: Row, time_ns: int) -> int:
        """Return the stamp of a message: strictly increasing on each topic, as a CRTK client wants it."""
        stamp_ns = self._stamps[row.topic] = max(self._start_ns + time_ns, self._stamps.get(row.topic, 0) + 1)
        return stamp_ns

    def write(self, row: Row, time_ns: int, message: Message | bytes) -> None:
        """Write a message, which gets its stamp here, or the bytes of one. Raises RecordingError if that
        fails.
        """
        payload = (
            message if isinstance(message, bytes) else encode(stamped(message, self.stamp_ns(row, time_ns)))
        )
        connection = self._connections.get(row.topic)
        if connection is None:
            connection = self._writer.add_connection(
                row.topic, row.type, typestore=typestore(), offered_qos_profiles=[_quality(row)]
            )
            self._connections[row.topic] = connection
        try:
            self._writer.write(connection, self._start_ns + time_ns, payload)
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
            rmtree(self.directory, ignore_errors=True)  # nobody could read it


def _quality(row: Row) -> Qos:
    """Return what the gateways offer: reliable; of latched topics late joiners get the last message."""
    durability, depth = (QosDurability.TRANSIENT_LOCAL, 1) if row.latched else (QosDurability.VOLATILE, 10)
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
