import errno
import json
import os
import resource
import signal
import struct
import subprocess
import sys
import threading
import time
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import Channel, Schema
from rosbags.highlevel import AnyReader

from hub.recording import recorder as recorder_module
from hub.recording.bag import Bag
from hub.recording.chunk import FIRST_BLOCK, chunk_data
from hub.recording.located_messages import located_messages
from hub.recording.mcap_file import create_bag
from hub.recording.recorder import Recorder
from hub.recording.recover import recover
from hub.recording.vector_block import VectorBlock
from schemas.codec import decode, encode
from schemas.errors import RecordingError
from schemas.ports import Port
from schemas.ros import Float64Message, Header, PoseStamped, Time
from schemas.trocar_msgs import AckMessage
from schemas.vectors import VectorCodec
from tests.strategies import ports, vectors

POSE = "geometry_msgs/msg/PoseStamped"


def _pose(time_ns: int) -> bytes:
    return encode(PoseStamped(header=Header(stamp=Time.from_ns(time_ns), frame_id="world")))


def test_a_recording_reads_back_in_order(tmp_path: Path) -> None:
    with Recorder(
        tmp_path / "run", attachments={"scenario.yaml": b"name: x\n", "versions.json": b"{}"}
    ) as recorder:
        pose = recorder.add_channel("/engine/robot/out/tip", POSE)
        given = [(pose, t * 1000, _pose(t * 1000)) for t in range(3000)]
        for message in given[:1500]:
            recorder.write(*message)
        ack = recorder.add_channel("/engine/robot/ack", "trocar_msgs/msg/Ack")
        for message in given[1500:]:
            recorder.write(*message)
        recorder.write(ack, 5, encode(AckMessage(run=1, epoch=0, step=4)))
        summary = recorder.close()
    assert (summary.complete, summary.messages, summary.dropped, summary.error) == (True, 3001, 0, None)
    assert summary.bytes == (tmp_path / "run" / "run_0.mcap").stat().st_size
    bag = Bag(tmp_path / "run")
    assert bag.topics == {"/engine/robot/out/tip": POSE, "/engine/robot/ack": "trocar_msgs/msg/Ack"}
    assert bag.counts == {"/engine/robot/out/tip": 3000, "/engine/robot/ack": 1}
    assert [(m.time_ns, m.payload) for m in bag.messages("/engine/robot/out/tip")] == [m[1:] for m in given]
    assert [decode(AckMessage, m.payload).step for m in bag.messages("/engine/robot/ack")] == [4]
    assert bag.attachments == {"scenario.yaml": b"name: x\n", "versions.json": b"{}"}


def test_a_long_recording_takes_no_more_memory_than_a_short_one(tmp_path: Path) -> None:
    chunk = chunk_data([(channel, 5, b"payload") for channel in range(1, 101)])
    file = create_bag(tmp_path / "run")
    for number in range(1, 101):
        schema = Schema(1, b"", "ros2msg", "std_msgs/msg/Empty")
        file.declare(schema, Channel(number, f"/{number}", "cdr", {}, 1))
    file.add_chunk(chunk)
    tracemalloc.start()
    try:
        for _ in range(500):
            file.add_chunk(chunk)
        grown, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    file.finish()
    file.close()
    assert grown < 100_000
    with file.path.open("rb") as stream:
        summary = make_reader(stream, validate_crcs=True).get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) == 501
    assert all(len(index.message_index_offsets) == 100 for index in summary.chunk_indexes)


def test_ros_tools_open_it(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run", attachments={"a.json": b"{}"}) as recorder:
        pose, number = (
            recorder.add_channel("/pose", POSE),
            recorder.add_channel("/number", "std_msgs/msg/Float64"),
        )
        for t in range(2000):
            recorder.write(pose, t, _pose(t))
            recorder.write(number, t, encode(Float64Message(data=t / 7)))
    with AnyReader([tmp_path / "run"]) as reader:
        assert reader.message_count == 4000
        assert {c.topic: c.msgtype for c in reader.connections} == {
            "/pose": POSE,
            "/number": "std_msgs/msg/Float64",
        }
        numbers = [
            reader.deserialize(raw, c.msgtype).data for c, _, raw in reader.messages() if c.topic == "/number"
        ]
        assert numbers == [t / 7 for t in range(2000)]
    with (tmp_path / "run" / "run_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        messages = list(reader.iter_messages())
        assert [(s.name, s.encoding, c.message_encoding) for s, c, _ in messages[:1] if s] == [
            (POSE, "ros2msg", "cdr")
        ]
        assert [m.log_time for _, _, m in messages] == sorted(2 * list(range(2000)))
        assert all(m.log_time == m.publish_time for _, _, m in messages)
        summary = reader.get_summary()
        assert summary is not None
        assert all(c.uncompressed_size <= 256 * 2**10 for c in summary.chunk_indexes)
        assert [a.name for a in reader.iter_attachments()] == ["a.json"]
        middle = [
            m.log_time for _, _, m in reader.iter_messages("/number", starting_at=500, ending_before=600)
        ]
        assert middle == list(range(500, 600))


@given(
    st.lists(
        st.tuples(st.integers(1, 9), st.integers(0, 2**62), st.binary(max_size=40)), min_size=1, max_size=50
    )
)
def test_chunk_layout_round_trips(messages: list[tuple[int, int, bytes]]) -> None:
    data = chunk_data(messages)
    located = list(located_messages(data.records))
    assert [(m.channel, m.time_ns, data.records[m.offset + 31 : m.end]) for m in located] == messages
    assert np.array_equal(data.offsets, [m.offset for m in located])


def test_a_message_is_as_the_format_has_it() -> None:
    data = chunk_data([(7, 5, b"abc")])
    assert data.records == struct.pack("<BQHIQQ", 5, 25, 7, 0, 5, 5) + b"abc"
    places = data.channels, data.times_ns, data.offsets
    assert [column.tolist() for column in places] == [[7], [5], [0]]


PORTS = (
    Port(name="tip", type=POSE, causality="output", frame="base"),
    Port(name="force", type="std_msgs/msg/Float64", causality="output"),
    Port(name="joints", type="sensor_msgs/msg/JointState", causality="output", names=("a", "b")),
    Port(name="nodes", type="std_msgs/msg/Float64MultiArray", causality="output", shape=(2, 3)),
)


@given(st.data())
def test_vectors_of_a_block_are_the_messages_that_their_codecs_make(data: st.DataObject) -> None:
    codecs = [VectorCodec(port) for port in data.draw(st.lists(ports(), min_size=1, max_size=5))]
    block = VectorBlock([(channel, codec) for channel, codec in enumerate(codecs, 1)])
    steps = data.draw(
        st.lists(
            st.tuples(
                st.integers(0, 2**31 * 10**9 - 1), st.booleans(), *(vectors(codec.size) for codec in codecs)
            ),
            min_size=1,
            max_size=8,
        )
    )
    queued: list[tuple[int, int, bytes]] = []
    expected: list[tuple[int, int, bytes]] = []
    for time_ns, with_another, *values in steps:
        if with_another:
            queued.append((9, time_ns, b"another message"))
            expected.append(queued[-1])
        queued.append((FIRST_BLOCK, time_ns, b"".join(value.tobytes() for value in values)))
        expected += [
            (channel, time_ns, codec.encode(value, time_ns))
            for channel, (codec, value) in enumerate(zip(codecs, values, strict=True), 1)
        ]
    made, alone = chunk_data(queued, [block]), chunk_data(expected)
    assert made.records == alone.records
    assert np.array_equal(made.channels, alone.channels)
    assert np.array_equal(made.times_ns, alone.times_ns)
    assert np.array_equal(made.offsets, alone.offsets)


def test_vectors_are_recorded_and_counted_as_messages(tmp_path: Path) -> None:
    codecs = [VectorCodec(port) for port in PORTS]
    with Recorder(tmp_path / "run", attachments={}) as recorder:
        channels = [recorder.add_channel(f"/{codec.port.name}", codec.port.type) for codec in codecs]
        block = recorder.add_block(list(zip(channels, codecs, strict=True)))
        values = [codec.neutral + np.arange(codec.size) for codec in codecs]
        for t in range(3000):
            recorder.write(block, t, b"".join(value.tobytes() for value in values))
        summary = recorder.close()
        recorder.write(block, 0, b"")
        assert recorder._dropped == len(codecs)
    assert (summary.complete, summary.messages) == (True, 3000 * len(codecs))
    bag = Bag(tmp_path / "run")
    for codec, value in zip(codecs, values, strict=True):
        found = [(m.time_ns, m.payload) for m in bag.messages(f"/{codec.port.name}")]
        assert found == [(t, codec.encode(value, t)) for t in range(3000)]


@given(st.binary(max_size=200))
def test_garbage_in_a_chunk_is_refused_not_read(garbage: bytes) -> None:
    try:
        located = list(located_messages(garbage))
    except (ValueError, struct.error):
        return
    assert all(m.end <= len(garbage) for m in located)


def test_several_threads_may_write(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run", attachments={}) as recorder:

        def work(index: int) -> None:
            channel = recorder.add_channel(f"/number{index}", "std_msgs/msg/Float64")
            for t in range(2000):
                recorder.write(channel, t, encode(Float64Message(data=float(t))))

        threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        summary = recorder.close()
    assert (summary.complete, summary.messages) == (True, 8000)
    bag = Bag(tmp_path / "run")
    for topic in bag.topics:
        assert [decode(Float64Message, m.payload).data for m in bag.messages(topic)] == list(range(2000))


def test_an_empty_recording_is_a_recording(tmp_path: Path) -> None:
    Recorder(tmp_path / "run", attachments={"a.json": b"{}"}).close()
    bag = Bag(tmp_path / "run")
    assert (bag.topics, list(bag.messages()), bag.duration_ns) == ({}, [], 0)


def test_a_channel_is_registered_once(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run", attachments={}) as recorder:
        assert recorder.add_channel("/pose", POSE) == recorder.add_channel("/pose", POSE)
        with pytest.raises(
            RecordingError,
            match=(
                r"unknown message type 'geometry_msgs/msg/PoseStampd'\. Did you mean"
                r" 'geometry_msgs/msg/PoseStamped'"
            ),
        ):
            recorder.add_channel("/other", "geometry_msgs/msg/PoseStampd")


def test_close_twice_and_write_after_close(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    recorder = Recorder(tmp_path / "run", attachments={})
    channel = recorder.add_channel("/pose", POSE)
    recorder.write(channel, 0, _pose(0))
    first = recorder.close()
    assert recorder.close() == first
    recorder.write(channel, 1, _pose(1))
    recorder.write(channel, 2, _pose(2))
    assert [r.message for r in caplog.records] == [
        f"recorder of '{tmp_path / 'run'}' drops messages, because it is closed: the recording is incomplete"
    ]


def test_overwrites_nothing(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "thesis.txt").write_text("all I have")
    with pytest.raises(
        RecordingError, match="is not empty, and a recording overwrites nothing: name a new directory"
    ):
        Recorder(tmp_path / "run", attachments={})


def test_a_place_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="name a directory that can be written"):
        Recorder(tmp_path / "file" / "run", attachments={})


def test_a_full_queue_drops_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    gate = threading.Event()
    monkeypatch.setattr(recorder_module, "MAX_QUEUED_MESSAGES", 1000)
    recorder = Recorder(tmp_path / "run", attachments={})
    append = recorder._file.add_chunk
    monkeypatch.setattr(recorder._file, "add_chunk", lambda data: gate.wait() and append(data))
    channel = recorder.add_channel("/pose", POSE)
    for t in range(5000):
        recorder.write(channel, t, _pose(t))
    gate.set()
    summary = recorder.close()
    assert not summary.complete
    assert summary.error is None
    assert summary.dropped > 0
    assert summary.messages + summary.dropped == 5000
    assert len(caplog.records) == 1
    assert len(list(Bag(tmp_path / "run").messages())) == summary.messages


def test_what_cannot_be_written_marks_the_recording(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    recorder = Recorder(tmp_path / "run", attachments={})
    channel = recorder.add_channel("/pose", POSE)
    recorder.write(channel, -1, _pose(0))
    summary = recorder.close()
    assert (summary.complete, summary.messages, summary.dropped) == (False, 0, 1)
    assert summary.error is not None
    assert "OverflowError" in summary.error
    assert len(caplog.records) == 1


FULL_DISK = """
import sys
from pathlib import Path
from hub.recording.recorder import Recorder
import json, logging, numpy as np
logging.basicConfig()
recorder = Recorder(Path(sys.argv[1]), attachments={"scenario.yaml": b"name: x"})
channel = recorder.add_channel("/noise", "std_msgs/msg/Float64MultiArray")
noise = np.random.default_rng(0)
import time
for t in range(2000):
    recorder.write(channel, t, noise.bytes(1000))
    if t % 100 == 0:
        time.sleep(0.01)
s = recorder.close()
print(json.dumps([s.complete, s.messages, s.dropped, s.error, s.bytes]))
"""


def _check_full_disk(
    directory: Path, output: Path, limit: int, run: "subprocess.CompletedProcess[str]", error: str
) -> None:
    complete, messages, dropped, said, size = json.loads(run.stdout)
    assert (complete, said) == (False, error)
    assert messages + dropped == 2000
    assert 0 < messages < 2000
    assert size <= limit
    assert run.stderr.count("has stopped") == 1
    assert f"has stopped: {error}. The session goes on; its recording is incomplete" in run.stderr
    saved = recover(directory, output)
    assert (saved.messages, saved.attachments, saved.damaged_chunks) == (messages, 1, 0)
    assert [m.time_ns for m in Bag(output).messages()] == list(range(messages))


def test_a_file_that_may_not_grow(tmp_path: Path) -> None:
    limit = 700_000
    run = subprocess.run(
        [sys.executable, "-c", FULL_DISK, tmp_path / "run"],
        capture_output=True,
        text=True,
        check=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )
    _check_full_disk(tmp_path / "run", tmp_path / "saved", limit, run, "File too large")


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = (
        os.geteuid() == 0
        and subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=800k", "tmpfs", disk], check=False, capture_output=True
        ).returncode
        == 0
    )
    if not mounted:
        pytest.skip("a small disk can be mounted by root only")
    yield disk
    subprocess.run(["umount", disk], check=True)


def test_a_full_disk(tmp_path: Path, small_disk: Path) -> None:
    run = subprocess.run(
        [sys.executable, "-c", FULL_DISK, small_disk / "run"], capture_output=True, text=True, check=True
    )
    _check_full_disk(small_disk / "run", tmp_path / "saved", 800 * 2**10, run, "No space left on device")


def test_nothing_is_recorded_after_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was queued while a chunk failed would fit on the disk, and leave a gap before it."""
    recorder = Recorder(tmp_path / "run", attachments={})
    channel, failing, queued = recorder.add_channel("/pose", POSE), threading.Event(), threading.Event()

    def fails_once(data: object) -> None:
        monkeypatch.undo()
        failing.set()
        queued.wait()
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(recorder._file, "add_chunk", fails_once)
    recorder.write_all([(channel, t, _pose(t)) for t in range(1000)])
    failing.wait()
    recorder.write_all([(channel, t, _pose(t)) for t in range(1000, 1010)])
    queued.set()
    summary = recorder.close()
    assert (summary.messages, summary.dropped, summary.error) == (0, 1010, "No space left on device")


@pytest.mark.long
def test_sigkill_loses_at_most_what_was_queued(tmp_path: Path) -> None:
    code = """
import sys
from pathlib import Path
from hub.recording.recorder import Recorder
recorder = Recorder(Path(sys.argv[1]), attachments={"scenario.yaml": b"name: x"})
channel = recorder.add_channel("/joy", "sensor_msgs/msg/Joy")
for t in range(2000):
    recorder.write(channel, t, bytes(100))
while recorder._file.statistics.message_count < 2000:
    pass
print("recorded", flush=True)
while True:
    t += 1
    recorder.write(channel, t, bytes(100))
"""
    process = subprocess.Popen(
        [sys.executable, "-c", code, tmp_path / "run"], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "recorded\n"
    time.sleep(0.3)
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    with pytest.raises(RecordingError, match="was cut short; `trocar recover"):
        Bag(tmp_path / "run")
    saved = recover(tmp_path / "run")
    assert saved.path == tmp_path / "run-recovered"
    assert saved.cut_short
    assert saved.attachments == 1
    times = [m.time_ns for m in Bag(saved.path).messages()]
    assert times == list(range(len(times)))
    assert len(times) >= 2000
    with AnyReader([saved.path]) as reader:
        assert reader.message_count == len(times)
