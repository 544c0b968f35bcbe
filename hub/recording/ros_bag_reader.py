"""ROS bags, read through `rosbags`: rosbag2 directories, .mcap and .db3 files, .bag files of ROS 1.

A session recorded by dvrk_data is read as the bag in it.
Their contents are untrusted: damaged bytes raise RecordingError, or are returned as the error of a message.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Collection, Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple, Self

import zstandard
from mcap.writer import MCAP0_MAGIC
from rosbags.highlevel import AnyReader
from rosbags.interfaces import Connection

from hub.recording.bounded_rosbags import bound_rosbags
from hub.recording.dvrk_session import session_bag
from hub.recording.unfinished import Unfinished
from hub.recording.unpacking import most_unpacked
from schemas.codec import typestore
from schemas.errors import RecordingError

__all__ = ["BagTopic", "RosBag"]

_ZSTD = b"\x28\xb5\x2f\xfd"
"""How a file compressed by Zstandard begins (RFC 8878, 3.1.1)."""
_SKIPPABLE, _SKIPPABLE_FIRST = b"\x2a\x4d\x18", 5
"""How a frame skipped begins, in front of others: 0x50 to 0x5F, then these (RFC 8878, 3.1.2)."""
_PIECE = 2**20
_SHARE = 0.5
"""Share of the free space for temporary files: `rosbags` unpacks a bag of compressed files there."""


class BagTopic(NamedTuple):
    """A topic of a bag."""

    type: str
    """ROS 2 type, also of a ROS 1 bag: `sensor_msgs/msg/JointState`."""
    messages: int


class RosBag:
    """A bag open for reading.

    Messages are read with the definitions in the bag, or with ours if the bag has none.
    """

    def __init__(self, path: Path) -> None:
        """Open a bag, or the bag of a session of dvrk_data. Raises RecordingError if it cannot be read."""
        self.path = path = session_bag(path)
        with _reading_errors(path):
            bound_rosbags()
            _require_bounded(path)
            self._reader = AnyReader([path], default_typestore=typestore())
            self._reader.open()
        self.topics: dict[str, BagTopic] = {}
        for one in self._reader.connections:
            known = self.topics.get(one.topic)
            self.topics[one.topic] = BagTopic(
                one.msgtype, one.msgcount + (known.messages if known is not None else 0)
            )
        self.start_ns = (
            self._reader.start_time if any(topic.messages for topic in self.topics.values()) else 0
        )
        """Wall time (ns) of the first message."""

    def messages(self, topics: Collection[str], start_ns: int) -> Iterator[tuple[str, int, object]]:
        """Yield topic, time (ns) and message since `start_ns`, in the order of time.

        The message is an object of `rosbags`, or the exception of a failed decoding. Raises RecordingError.
        """
        connections: list[Connection] = [one for one in self._reader.connections if one.topic in topics]
        if not connections:
            return
        with _reading_errors(self.path):
            for connection, time_ns, payload in self._reader.messages(connections, start=start_ns):
                yield connection.topic, time_ns, self._decode_message(payload, connection.msgtype)

    def _decode_message(self, payload: bytes, type_name: str) -> object:
        try:
            return self._reader.deserialize(payload, type_name)
        # rosbags lets struct.error, IndexError, UnicodeDecodeError and more through
        except Exception as error:  # noqa: BLE001
            return error

    def close(self) -> None:
        """Close the file. May be called twice."""
        if self._reader.stack is not None:
            self._reader.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _require_bounded(bag: Path) -> None:
    """Raise RecordingError if a file of a bag is none, or is a bomb or does not fit on the disk."""
    space = int(shutil.disk_usage(tempfile.gettempdir()).free * _SHARE)
    for file in sorted(bag.iterdir()) if bag.is_dir() else (bag,):
        if file.is_dir() or not file.exists():  # what is missing is reported by its reader
            continue
        if not file.is_file():
            raise RecordingError(f"'{file}' is no regular file: it may be a pipe that never ends")
        most = most_unpacked(file.stat().st_size)
        with file.open("rb") as packed:
            begin = packed.read(len(_ZSTD))
        if begin == _ZSTD or (begin[1:] == _SKIPPABLE and begin[0] >> 4 == _SKIPPABLE_FIRST):
            size = _unpacked_size(file, min(space, most))
            space -= size
        elif begin == MCAP0_MAGIC[: len(_ZSTD)]:
            chunks = Unfinished(file)
            chunks.grow()
            size = sum(index.uncompressed_size for index in chunks.summary.chunk_indexes)
        else:
            continue
        if size > most:
            raise RecordingError(
                f"'{file}' would unpack to more than {most} bytes: it is damaged, or made to fill memory"
            )
        if space < 0:
            raise RecordingError(
                f"the bag '{bag}' is not unpacked: its compressed files need more than half of what is free"
                f" in {tempfile.gettempdir()}. Set TMPDIR to a larger disk, or use compression by message"
            )


def _unpacked_size(file: Path, most: int) -> int:
    """Return the unpacked size of a file, or a size above `most` once known to be larger."""
    size = 0
    with (
        file.open("rb") as packed,
        zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True) as unpacked,
    ):
        while size <= most and (piece := unpacked.read(_PIECE)):
            size += len(piece)
    return size


@contextmanager
def _reading_errors(path: Path) -> Generator[None]:
    """Turn every exception of the parsers at damaged bytes into a RecordingError."""
    try:
        yield
    except (RecordingError, GeneratorExit):
        raise
    # rosbags raises errors of its own, KeyError, struct.error, sqlite3's and zstd's
    except Exception as error:
        raise RecordingError(
            f"cannot read the bag '{path}' ({type(error).__name__}: {error}); a rosbag2 directory, an .mcap,"
            " .db3 or .bag file is expected"
        ) from error
