import struct
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.highlevel import AnyReader

from hub.recording.bag_files import default_output
from hub.recording.recorder import Recorder
from hub.recording.recording import Recording
from hub.recording.recover import recover
from schemas.codec import encode, ros2msg_definition
from schemas.errors import RecordingError
from schemas.ros import Float64Message
from tests.hub.sample_session import ATTACHMENTS, write_session


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session of many chunks, though it is short."""
    directory = tmp_path_factory.mktemp("session") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hub.recording.recorder.CHUNK_BYTES", 2**16)
        write_session(directory)
    return directory


@pytest.mark.parametrize("share", [0.3, 0.7, 0.95])
def test_a_file_cut_anywhere_gives_back_a_prefix(session: Path, tmp_path: Path, share: float) -> None:
    whole = (session / "run_0.mcap").read_bytes()
    file = tmp_path / "cut.mcap"
    file.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(RecordingError, match="was cut short"):
        Recording(file)
    saved = recover(file)
    assert saved.path == tmp_path / "cut-recovered"
    assert (saved.cut_short, saved.damaged_chunks, saved.attachments) == (True, 0, len(ATTACHMENTS))
    recording = Recording(saved.path)
    messages = list(recording.messages())
    assert messages == list(Recording(session).messages())[: saved.messages]
    assert saved.end_ns == max((m.time_ns for m in messages), default=0)  # the first chunk may be cut
    assert recording.attachments == ATTACHMENTS
    assert recording.scenario().name == "palpation"
    with AnyReader([saved.path]) as reader:
        assert reader.message_count == saved.messages


def test_every_cut_is_survived(session: Path, tmp_path: Path) -> None:
    whole = (session / "run_0.mcap").read_bytes()
    file = tmp_path / "cut.mcap"
    before = 0
    for number, length in enumerate(range(8, len(whole), len(whole) // 60)):
        file.write_bytes(whole[:length])
        saved = recover(file, tmp_path / str(number))
        assert saved.messages >= before
        before = saved.messages
    assert before > 0


@pytest.mark.parametrize("length", [2**60, 2**63])
def test_a_record_of_a_length_that_cannot_be_is_the_end(session: Path, tmp_path: Path, length: int) -> None:
    whole = (session / "run_0.mcap").read_bytes()
    name, data = next(iter(ATTACHMENTS.items()))
    stated = struct.pack("<Q", len(data)) + data  # of the attachment in its record
    assert name.encode() in whole
    file = tmp_path / "long.mcap"
    file.write_bytes(whole.replace(stated, struct.pack("<Q", length) + data, 1))
    saved = recover(file)
    assert (saved.cut_short, saved.attachments, saved.messages) == (True, 0, 0)


def test_zeros_at_the_end_after_a_power_loss(session: Path, tmp_path: Path) -> None:
    whole = (session / "run_0.mcap").read_bytes()
    half = len(whole) // 2
    (tmp_path / "x.mcap").write_bytes(whole[:half] + bytes(4096))
    (tmp_path / "y.mcap").write_bytes(whole[:half])
    assert recover(tmp_path / "x.mcap").messages == recover(tmp_path / "y.mcap").messages > 0


def test_a_damaged_chunk_is_left_out_and_counted(session: Path, tmp_path: Path) -> None:
    whole = bytearray((session / "run_0.mcap").read_bytes())
    total = sum(Recording(session).counts.values())
    with (session / "run_0.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    chunk = summary.chunk_indexes[1]
    whole[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 0xFF
    (tmp_path / "x.mcap").write_bytes(whole)
    saved = recover(tmp_path / "x.mcap")
    assert (saved.damaged_chunks, saved.cut_short) == (1, False)
    assert 0 < saved.messages < total
    assert len(list(Recording(saved.path).messages())) == saved.messages


def test_a_whole_recording_is_copied(session: Path, tmp_path: Path) -> None:
    saved = recover(session, tmp_path / "copy")
    assert not saved.cut_short
    assert list(Recording(saved.path).messages()) == list(Recording(session).messages())


def test_files_of_other_writers_keep_their_channels(tmp_path: Path) -> None:
    with (tmp_path / "x.mcap").open("wb") as stream:
        writer = Writer(stream, chunk_size=1000)
        writer.start("ros2")
        schema = writer.register_schema(
            Float64Message.ros_type, "ros2msg", ros2msg_definition(Float64Message.ros_type).encode()
        )
        channel = writer.register_channel("/x", "cdr", schema)
        for t in range(100):
            writer.add_message(channel, t, encode(Float64Message(data=t)), t)
        stream.flush()
    saved = recover(tmp_path / "x.mcap")
    assert saved.messages > 50
    assert Recording(saved.path)["/x"].values[:, 0].tolist() == list(range(saved.messages))


def test_messages_outside_chunks_are_not_ours(tmp_path: Path) -> None:
    with (tmp_path / "x.mcap").open("wb") as stream:
        writer = Writer(stream, use_chunking=False)
        writer.start("ros2")
        channel = writer.register_channel("/x", "cdr", writer.register_schema("x", "ros2msg", b""))
        writer.add_message(channel, 0, b"", 0)
    with pytest.raises(RecordingError, match="outside chunks"):
        recover(tmp_path / "x.mcap")


def test_overwrites_nothing_and_wants_a_recording(session: Path, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="is not empty"):
        recover(session, session)
    (tmp_path / "x.mcap").write_bytes(b"nothing like it")
    with pytest.raises(RecordingError, match="is not an MCAP file"):
        recover(tmp_path / "x.mcap")
    assert not (tmp_path / "x-recovered").exists()
    with pytest.raises(RecordingError, match="no recording at"):
        recover(tmp_path / "y.mcap")


def test_an_empty_recording(tmp_path: Path) -> None:
    Recorder(tmp_path / "run", attachments={}).close()
    saved = recover(tmp_path / "run")
    assert (saved.messages, saved.chunks, saved.end_ns) == (0, 0, 0)


def test_outputs_beside_a_recording_have_its_name(tmp_path, monkeypatch):
    """A directory may have a dot in its name; a recording may be the working directory."""
    directory, file = tmp_path / "run-0.5", tmp_path / "run.mcap"
    directory.mkdir()
    file.touch()
    monkeypatch.chdir(directory)
    places = [directory, file, Path(), Path("../run-0.5")]
    assert [default_output(place, ".png").resolve() for place in places] == [
        tmp_path / name for name in ("run-0.5.png", "run.png", "run-0.5.png", "run-0.5.png")
    ]
