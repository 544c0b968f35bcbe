"""Files that unpack to far more than they have: refused with a sentence, in bounded memory.

Each command runs in a process of its own, whose address space is limited.
"""

from __future__ import annotations

import bz2
import os
import random
import sqlite3
import struct
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

from hub.recording.bag import Bag
from hub.recording.family import recording_family
from hub.recording.recover import recover
from hub.recording.ros_bag_reader import RosBag
from hub.recording.unpacking import MAX_CHUNK_BYTES, unpack
from schemas.codec import typestore
from schemas.errors import RecordingError
from tests.hub.recording.packed_zeros import MiB, packed_zeros
from tests.hub.sample_session import write_session

_ALLOWED_BYTES = 2**31
"""Address space of a command: numpy and zenoh alone take 1 GiB of it."""

SKIPPED = b"\x50\x2a\x4d\x18\x04\x00\x00\x00skip"
"""A frame of zstd without contents."""

PACKERS: dict[str, Callable[[bytes], bytes]] = {"lz4": lz4.frame.compress, "zstd": zstandard.compress}


def chunk(compression: str, packed: bytes, stated: int) -> bytes:
    """Return the record of a chunk."""
    name = compression.encode()
    body = struct.pack("<QQQI", 0, 1, stated, 0) + struct.pack("<I", len(name)) + name
    body += struct.pack("<Q", len(packed)) + packed
    return struct.pack("<BQ", Opcode.CHUNK, len(body)) + body


def with_bomb(directory: Path, compression: str, size: int, stated: int | None = None) -> Path:
    """Return a recording that was cut short, in which a chunk of zeros stands first."""
    write_session(directory, 0.02)
    (file,) = directory.glob("*.mcap")
    data = file.read_bytes()
    head = data.index(b"trocar") + len(b"trocar")
    bomb = chunk(compression, packed_zeros(compression, size), size if stated is None else stated)
    file.write_bytes(data[:head] + bomb + data[head : -len(MCAP0_MAGIC) - 20])
    return file


@pytest.mark.parametrize("compression", PACKERS)
def test_no_more_than_is_allowed_is_unpacked(compression: str) -> None:
    content = b"trocar" * 1000
    assert unpack(compression, PACKERS[compression](content), len(content)) == content
    with pytest.raises(ValueError, match="more than the 5999 bytes"):
        unpack(compression, PACKERS[compression](content), 5999)
    with pytest.raises(ValueError, match=f"more than the {MAX_CHUNK_BYTES} bytes"):
        unpack(compression, packed_zeros(compression, MAX_CHUNK_BYTES + MiB))


@pytest.mark.parametrize("compression", [*PACKERS, "bz2"])
def test_a_frame_that_is_cut_short_is_refused(compression: str) -> None:
    content = random.Random(5).randbytes(300_000)
    packed = {**PACKERS, "bz2": bz2.compress}[compression](content)
    assert unpack(compression, packed) == content
    for size in (0, 3, 8, len(packed) // 2, len(packed) - 1):
        with pytest.raises((ValueError, zstandard.ZstdError)):
            unpack(compression, packed[:size])


@pytest.mark.parametrize("checksum", [False, True])
def test_a_series_of_frames_is_whole_only_to_the_end_of_the_last(checksum: bool) -> None:
    frame = zstandard.ZstdCompressor(write_content_size=False, write_checksum=checksum)
    content = random.Random(5).randbytes(200_000) + bytes(200_000)
    packed = SKIPPED + frame.compress(content)
    assert unpack("zstd", packed * 2) == content * 2
    for size in range(len(packed) + 1, 2 * len(packed), 997):
        with pytest.raises((ValueError, zstandard.ZstdError)):
            unpack("zstd", (packed * 2)[:size])
    first_block = len(SKIPPED) + zstandard.frame_header_size(packed[len(SKIPPED) :]) + 3 + 2**17
    with pytest.raises(ValueError, match="cut short"):
        unpack("zstd", packed[:first_block])


@pytest.mark.long
@pytest.mark.parametrize("stated", [1000 * MiB, 1000], ids=["true size", "false size"])
@pytest.mark.parametrize("compression", PACKERS)
def test_a_bomb_in_a_recording(tmp_path: Path, compression: str, stated: int) -> None:
    file = with_bomb(tmp_path / "run", compression, 1000 * MiB, stated)
    code = f"""
import resource, sys
from pathlib import Path
from hub.recording.bag import Bag
from hub.recording.family import recording_family
from hub.recording.recover import recover
from schemas.codec import typestore
from schemas.errors import RecordingError
import numpy
resource.setrlimit(resource.RLIMIT_AS, ({_ALLOWED_BYTES}, {_ALLOWED_BYTES}))
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(recover(Path({str(file)!r}), Path({str(tmp_path / "whole")!r})).damaged_chunks)
list(recording_family([Path({str(tmp_path)!r})]))
try:
    for _ in Bag({str(file)!r}, unfinished=True).messages():
        pass
except RecordingError as error:
    print("refused")
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    damaged, refused, mb = done.stdout.split()
    assert (damaged, refused) == ("1", "refused")
    assert int(mb) < 300


def test_a_chunk_of_empty_records_takes_no_minute(tmp_path: Path) -> None:
    """A reader spends 200 bytes and a microsecond on each."""
    records = struct.pack("<BQ", 255, 0) * (MAX_CHUNK_BYTES // 9)
    write_session(tmp_path / "run", 0.01)
    (file,) = (tmp_path / "run").glob("*.mcap")
    data = file.read_bytes()
    head = data.index(b"trocar") + len(b"trocar")
    bomb = chunk("zstd", zstandard.compress(records), len(records))
    file.write_bytes(data[:head] + bomb + data[head : -len(MCAP0_MAGIC) - 20])
    assert recover(file, tmp_path / "whole").damaged_chunks == 1


def test_one_bomb_does_not_hide_the_recordings_beside_it(tmp_path: Path) -> None:
    with_bomb(tmp_path / "bomb", "zstd", 300 * MiB)
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "odd.mcap").write_bytes(b"no recording")
    write_session(tmp_path / "good", 0.02)
    assert [one.file.parent.name for one in recording_family([tmp_path])] == ["good"]


def test_a_file_that_states_too_much_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    write_session(tmp_path / "run", 0.01)
    (file,) = (tmp_path / "run").glob("*.mcap")
    data = file.read_bytes()
    bomb = chunk("zstd", packed_zeros("zstd", MiB), 60 * MiB) * 10
    head = data.index(b"trocar") + len(b"trocar")
    file.write_bytes(data[:head] + bomb + data[head : -len(MCAP0_MAGIC) - 20])
    with pytest.raises(RecordingError, match="and would unpack to"):
        Bag(file, unfinished=True)


@pytest.mark.parametrize("front", [b"", SKIPPED], ids=["alone", "behind"])
def test_a_compressed_file_of_a_ros_bag(tmp_path: Path, front: bytes) -> None:
    """A frame that is skipped may stand in front of the bomb."""
    (tmp_path / "bag").mkdir()
    packed = front + packed_zeros("zstd", 600 * MiB)
    (tmp_path / "bag" / "bag_0.db3.zstd").write_bytes(packed)
    (tmp_path / "bag" / "metadata.yaml").write_text(
        "rosbag2_bagfile_information: {version: 5, storage_identifier: sqlite3, compression_format: zstd,"
        " compression_mode: FILE, relative_file_paths: [bag_0.db3.zstd], message_count: 0,"
        " duration: {nanoseconds: 0}, starting_time: {nanoseconds_since_epoch: 0},"
        " topics_with_message_count: []}"
    )
    with pytest.raises(RecordingError, match="would unpack to more than"):
        RosBag(tmp_path / "bag")


@pytest.mark.parametrize("compression", Ros1Writer.CompressionFormat)
def test_a_bomb_in_a_bag_of_ros_1(tmp_path: Path, compression: Ros1Writer.CompressionFormat) -> None:
    writer = Ros1Writer(tmp_path / "one.bag")
    writer.set_compression(compression)
    store = get_typestore(Stores.ROS1_NOETIC)
    with writer:
        connection = writer.add_connection("/text", "std_msgs/msg/String", typestore=store)
        writer.write(connection, 1, bytes(100 * MiB))
    _require_refusal(tmp_path / "one.bag")


@pytest.mark.parametrize("storage", StoragePlugin)
def test_a_bomb_in_a_message_of_a_bag_of_ros_2(tmp_path: Path, storage: StoragePlugin) -> None:
    writer = Ros2Writer(tmp_path / "bag", version=9, storage_plugin=storage)
    by_chunk = storage == StoragePlugin.MCAP
    mode = CompressionMode.STORAGE if by_chunk else CompressionMode.MESSAGE
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/text", "std_msgs/msg/String", typestore=typestore())
        writer.write(connection, 1, bytes(100 * MiB))
    _require_refusal(tmp_path / "bag")


def test_a_message_that_is_cut_short_in_a_bag_of_ros_2(tmp_path: Path) -> None:
    writer = Ros2Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3)
    writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/text", "std_msgs/msg/String", typestore=typestore())
        writer.write(connection, 1, random.Random(5).randbytes(300_000))
    (file,) = (tmp_path / "bag").glob("*.db3")
    with closing(sqlite3.connect(file)) as database, database:
        database.execute("UPDATE messages SET data = substr(data, 1, 200000)")
    _require_refusal(tmp_path / "bag", "cut short")


def _require_refusal(bag: Path, why: str = f"more than the {MAX_CHUNK_BYTES} bytes") -> None:
    with RosBag(bag) as opened, pytest.raises(RecordingError, match=why):
        list(opened.messages(["/text"], 0))


def test_a_pipe_in_a_ros_bag_is_not_waited_for(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    os.mkfifo(tmp_path / "bag" / "metadata.yaml")
    with pytest.raises(RecordingError, match="no regular file"):
        RosBag(tmp_path / "bag")
