import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import Writer

from hub.recording.recorder import Recorder
from hub.recording.recording import Recording
from schemas.codec import encode
from schemas.errors import RecordingError
from schemas.ros import Float64Message
from tests.hub.sample_session import ATTACHMENTS, BOND, write_session


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("session") / "run"
    assert write_session(directory).complete
    return directory


def test_grants_acks_and_books(session: Path) -> None:
    recording = Recording(session)
    grants = list(recording.grants())
    assert [g.step for g in grants] == list(range(500))
    assert [len(g.inlets) for g in grants] == [1, 0, 0, 0] * 125
    assert [a.state_hash.tolist() for a in recording.acks("robot")] == [[i] for i in range(500)]
    assert list(recording.acks("stranger")) == []
    books = list(recording.energy(BOND))
    assert [t for t, _ in books] == [(i + 1) * 1_000_000 for i in range(500)]
    assert all(b.residual_j == b.force_work_j - b.motion_work_j for _, b in books)
    assert [s.step for _, s in recording.statuses()] == [100, 200, 300, 400, 500]


def test_scenario_and_versions(session: Path) -> None:
    recording = Recording(session)
    assert recording.scenario().name == "palpation"
    assert recording.scenario().bonds[0].name == BOND
    assert recording.versions()["mujoco"] == "4.0.0"
    assert list(recording.files()) == ["/data/hand/hand.mcap"]
    assert recording.session() == "palpation"
    assert recording.attachments == ATTACHMENTS


def test_the_file_itself_may_be_named(session: Path) -> None:
    assert Recording(session / "run_0.mcap").topics == Recording(session).topics


def test_payloads_are_not_trusted(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run", attachments={}) as recorder:
        recorder.write(recorder.add_channel("/hub/grant", "trocar_msgs/msg/Grant"), 3, b"no grant")
        recorder.write(
            recorder.add_channel("/number", Float64Message.ros_type),
            3,
            encode(Float64Message())[:4] + np.array([np.nan]).tobytes(),
        )
    recording = Recording(tmp_path / "run")
    with pytest.raises(
        RecordingError, match="topic '/hub/grant' at 3 ns: trocar_msgs/msg/Grant: 8 bytes are no such message"
    ):
        list(recording.grants())
    with pytest.raises(RecordingError, match=r"topic '/number' at 3 ns: .*finite"):
        _ = recording["/number"].values


@pytest.mark.parametrize(
    ("attachments", "problem"),
    [
        ({}, "holds no scenario: it was not recorded by `trocar run`"),
        ({"scenario.json": b"{"}, "this version cannot read the scenario in it: ValueError"),
        ({"scenario.json": b"[1]"}, "this version cannot read the scenario in it: TypeError"),
        ({"scenario.json": b"{}"}, "this version cannot read the scenario in it: KeyError: 'participants'"),
        (
            {"scenario.json": json.dumps({"name": "x", "step": "soon", "participants": {}}).encode()},
            "this version cannot read the scenario in it: step",
        ),
    ],
)
def test_a_recording_without_a_readable_scenario(
    tmp_path: Path, attachments: dict[str, bytes], problem: str
) -> None:
    Recorder(tmp_path / "run", attachments=attachments).close()
    with pytest.raises(RecordingError, match=problem):
        Recording(tmp_path / "run").scenario()


def test_versions_that_are_not_a_table(tmp_path: Path) -> None:
    Recorder(tmp_path / "run", attachments={"versions.json": b"[1]"}).close()
    with pytest.raises(RecordingError, match=r"versions\.json is not a table"):
        Recording(tmp_path / "run").versions()


def test_what_is_no_recording(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no recording at"):
        Recording(tmp_path / "missing")
    with pytest.raises(RecordingError, match=r"holds 0 \.mcap files"):
        Recording(tmp_path)
    for content in (b"", b"PK\x03\x04 something else", b"\x89MCAP0\r\n"):
        (tmp_path / "x.mcap").write_bytes(content)
        with pytest.raises(RecordingError, match=r"not an MCAP file|was cut short"):
            Recording(tmp_path / "x.mcap")


def test_messages_that_are_not_cdr(tmp_path: Path) -> None:
    with (tmp_path / "x.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.register_channel("/x", "json", writer.register_schema("x", "jsonschema", b"{}"))
        writer.finish()
    with pytest.raises(RecordingError, match="topic '/x' is encoded as 'json'; only 'cdr'"):
        Recording(tmp_path / "x.mcap")


@given(data=st.data())
def test_a_damaged_file_is_refused_or_read_never_more(
    session: Path, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    whole = (session / "run_0.mcap").read_bytes()
    damaged = bytearray(whole)
    for _ in range(data.draw(st.integers(1, 3))):
        damaged[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    file = tmp_path_factory.getbasetemp() / "damaged.mcap"
    file.write_bytes(damaged)
    try:
        recording = Recording(file)
        read = list(recording.messages())
        list(recording.grants())
        recording.column("/engine/robot/ack")
        _ = recording.attachments
    except RecordingError:
        return
    assert len(read) <= sum(Recording(session).counts.values())
