"""Recordings with odd attachments, names and numbers of ports: a sentence each, and never a wait."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from hub.command_line.app import options as command_line
from hub.recording import bag
from hub.recording.family import recording_family
from hub.recording.fork_origin import fork_origin
from hub.recording.recorder import Recorder
from hub.recording.recording import Recording
from schemas.codec import encode
from schemas.errors import RecordingError
from schemas.keys import Keys, topic
from schemas.ros import Float64Message
from schemas.trocar_msgs import GrantMessage
from tests.hub.sample_session import ATTACHMENTS, write_session

DEEP = b'{"a":' * 100_000 + b"1" + b"}" * 100_000


def recorded(directory: Path, **changes: bytes) -> Recording:
    """Return a recording of one grant with other attachments: `scenario=b"..."`."""
    others = {f"{name}.json": content for name, content in changes.items()}
    with Recorder(directory, attachments={**ATTACHMENTS, **others}) as recorder:
        channel = recorder.add_channel(topic(Keys("x").grant), GrantMessage.ros_type)
        grant = GrantMessage(run=7, epoch=0, step=0, start_ns=0, horizon_ns=10**6, inlets=[])
        recorder.write(channel, 0, encode(grant))
    return Recording(directory)


@pytest.mark.parametrize("name", ["scenario", "plan", "origin", "files", "versions", "fork"])
def test_an_attachment_that_is_nested_too_deep(tmp_path: Path, name: str) -> None:
    recording = recorded(tmp_path / "run", **{name: DEEP})
    reads: dict[str, Callable[[], object]] = {
        "scenario": recording.scenario,
        "plan": recording.plan,
        "origin": recording.directory,
        "files": recording.files,
        "versions": recording.versions,
        "fork": lambda: fork_origin(recording),
    }
    with pytest.raises(RecordingError):
        reads[name]()
    list(recording_family([tmp_path]))


def test_a_newer_recording_is_said_to_be_newer(tmp_path: Path) -> None:
    versions = json.dumps({"trocar": "99.1"}).encode()
    scenario = json.dumps({"name": "x", "step": "1 ms", "participants": {"a": {}}, "of tomorrow": 1}).encode()
    recording = recorded(tmp_path / "run", versions=versions, scenario=scenario, plan=b"{}")
    for read in (recording.scenario, recording.plan):
        with pytest.raises(RecordingError, match=r"Trocar 99\.1 has made it, which is newer than .*: update"):
            read()


def test_a_newer_recording_is_said_to_be_newer_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    recording = recorded(tmp_path / "run", versions=json.dumps({"trocar": "99.1"}).encode())
    for _ in range(2):
        recording.warn_if_newer()
    assert caplog.text.count("Trocar 99.1 has made it") == 1


def test_a_list_of_forks_passes_over_what_cannot_be_read(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    recorded(tmp_path / "odd", scenario=b"{}")
    write_session(tmp_path / "good", 0.01)
    with caplog.at_level(logging.INFO):
        assert [one.file.parent.name for one in recording_family([tmp_path])] == ["good"]
    assert "passed over" in caplog.text


def test_names_of_attachments_lead_nowhere(tmp_path: Path) -> None:
    names = ("../../outside", "", "/etc/passwd", "\x1b[2J", "a" * 10_000)
    Recorder(tmp_path / "run", attachments=dict.fromkeys(names, b"x")).close()
    recording = Recording(tmp_path / "run")
    assert set(names) <= set(recording.attachments)
    assert not (tmp_path.parent / "outside").exists()


def test_a_chunk_is_unpacked_once_for_all_topics_that_begin_in_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A page asks for the first message of each; 20 000 of them took more than a minute."""
    with Recorder(tmp_path / "run", attachments=ATTACHMENTS) as recorder:
        for i in range(300):
            channel = recorder.add_channel(f"/engine/a/out/p{i}", Float64Message.ros_type)
            recorder.write(channel, i, encode(Float64Message(data=1.0)))
    recording, unpacked = Recording(tmp_path / "run"), list[int]()
    unpack = bag.chunk_records
    monkeypatch.setattr(bag, "chunk_records", lambda chunk: (unpacked.append(1), unpack(chunk))[1])
    for name in recording.topics:
        next(recording.messages(name))
    assert len(unpacked) == len(recording.chunks)


def test_a_line_of_the_log_is_no_command_to_the_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    root, before = logging.getLogger(), logging.getLogger().handlers[:]
    root.handlers.clear()
    try:
        command_line(SimpleNamespace(invoked_subcommand="run"), debug=False)
        logging.getLogger("hub.recording").warning("file '%s'", "\x1b]0;title\x07")
    finally:
        root.handlers[:] = before
    err = capfd.readouterr().err
    assert "title" in err
    assert "\x1b" not in err
