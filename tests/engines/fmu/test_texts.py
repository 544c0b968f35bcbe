"""Texts and bytes of FMUs as messages."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engines.fmu.engine import FmuEngine, FmuParams
from hub.participant import Inputs, Setup
from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from hub.verify import verify
from schemas.codec import decode, encode
from schemas.errors import ScenarioError, SessionError
from schemas.ros import StringMessage, UInt8MultiArray
from tests.engines.fmu.driving import BALL, MS, Make, inputs_of, ports
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

NOTES = "notes"
FOLDERS = {2: ("linux64", "modelDescription.xml"), 3: ("x86_64-linux", "modelDescription3.xml")}
NOT_UTF8, NO_ADDRESS = 1, 2
"""Values of the parameter `fault`."""


@pytest.fixture(scope="session")
def notes_libraries(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """Libraries by version of FMI."""
    return {
        fmi: build.compile_library(NOTES, tmp_path_factory.mktemp(f"notes{fmi}"), f"-DFMI={fmi}")
        for fmi in FOLDERS
    }


@pytest.fixture
def notes(notes_libraries: dict[int, Path], tmp_path: Path) -> Iterator[Any]:
    """Makes a configured engine."""
    engines: list[FmuEngine] = []

    def make(fmi: int = 3, **params: Any) -> FmuEngine:
        folder, description = FOLDERS[fmi]
        path = tmp_path / f"{len(engines)}.fmu"
        build.pack(NOTES, notes_libraries[fmi], path, folder=folder, description=description)
        engines.append(FmuEngine("notes", FmuParams(path=path, **params)))
        engines[-1].configure(Setup(period_ns=MS, directory=tmp_path))
        return engines[-1]

    yield make
    for engine in engines:
        engine.close()


def step(engine: FmuEngine, k: int, text: str | None = None, frame: bytes | None = None) -> Any:
    values = {
        "text": None if text is None else StringMessage(data=text),
        "frame": None if frame is None else UInt8MultiArray(data=np.frombuffer(frame, np.uint8)),
    }
    return engine.step(k * MS, MS, Inputs(values))


@given(st.text(st.characters(codec="utf-8", exclude_characters="\0")), st.binary())
def test_values_go_through_messages_unchanged(text: str, frame: bytes) -> None:
    assert decode(StringMessage, encode(StringMessage(data=text))).data == text
    sent = UInt8MultiArray(data=np.frombuffer(frame, np.uint8))
    assert decode(UInt8MultiArray, encode(sent)).data.tobytes() == frame


def test_ports(notes: Any) -> None:
    found = ports(notes())
    assert {name: (port.type, port.causality) for name, port in found.items() if name != "events"} == {
        "text": ("std_msgs/msg/String", "input"),
        "frame": ("std_msgs/msg/UInt8MultiArray", "input"),
        "said": ("std_msgs/msg/String", "output"),
        "mirrored": ("std_msgs/msg/UInt8MultiArray", "output"),
    }
    assert "the text, and the number of steps" in found["said"].description


def test_an_array_of_texts_is_left_out_with_a_reason(notes: Any, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "engines.fmu"):
        notes()
    assert "output 'list' becomes no port: it is an array of type String, or clocked" in caplog.text


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_text_goes_in_and_out(notes: Any, fmi: int) -> None:
    engine = notes(fmi, start={"text": "Faden"})
    assert step(engine, 0)["said"].data == "Faden, step 1"
    assert step(engine, 1, "Schere, größer")["said"].data == "Schere, größer, step 2"
    assert step(engine, 2, "")["said"].data == ", step 3"
    assert step(engine, 3)["said"].data == ", step 4"


def test_bytes_go_in_and_out(notes: Any) -> None:
    engine = notes()
    assert step(engine, 0)["mirrored"].data.tolist() == [1]
    assert step(engine, 1, frame=b"\1\0\3")["mirrored"].data.tolist() == [3, 0, 1, 2]
    assert step(engine, 2, frame=b"")["mirrored"].data.tolist() == [3]


def test_only_a_change_is_an_event_also_after_a_return_to_a_saved_state(notes: Any) -> None:
    engine = notes()
    first = [step(engine, k, "a", b"b")["events"][0] for k in range(3)]
    assert first == [1, 1, 1]
    saved, hashed = engine.save(), engine.state_hash()
    assert step(engine, 3, "c", b"d")["events"][0] == 2
    engine.restore(saved)
    assert engine.state_hash() == hashed
    outputs = step(engine, 3, "a", b"b")
    assert (outputs["said"].data, outputs["events"][0]) == ("a, step 4", 1)


class TestBadValues:
    def test_a_zero_in_a_text(self, notes: Any) -> None:
        with pytest.raises(SessionError, match="input 'text' takes a text without zero characters"):
            step(notes(), 0, "a\0b")

    def test_no_utf8(self, notes: Any) -> None:
        with pytest.raises(SessionError, match="output 'said' is no text in UTF-8"):
            notes(start={"fault": NOT_UTF8})

    def test_no_address(self, notes: Any) -> None:
        with pytest.raises(SessionError, match="'said' has no value: the FMU returned a null pointer"):
            notes(start={"fault": NO_ADDRESS})

    def test_an_error_of_the_fmu(self, notes: Any) -> None:
        with pytest.raises(SessionError, match="fmi3SetString returned 'error' for 'text'"):
            step(notes(), 0, "a" * 200)

    def test_no_start_value_for_bytes(self, notes: Any) -> None:
        with pytest.raises(ScenarioError, match="'frame' is a Binary, which takes no start value here"):
            notes(start={"frame": "00"})

    def test_an_fmu_that_does_not_give_the_value(self, make: Make, caplog: pytest.LogCaptureFixture) -> None:
        with caplog.at_level(logging.WARNING):
            engine = make(BALL)
        outputs: Any = engine.step(0, MS, inputs_of(engine))
        assert outputs["image"].data.size == 0
        assert "output 'image' stays empty: the FMU does not give its value" in caplog.text


@pytest.mark.long
@pytest.mark.parametrize("host", ["", ", host: other"])
def test_a_session_carries_records_and_verifies(
    notes_libraries: dict[int, Path], tmp_path: Path, host: str
) -> None:
    folder, description = FOLDERS[3]
    path = tmp_path / "notes.fmu"
    build.pack(NOTES, notes_libraries[3], path, folder=folder, description=description)
    (tmp_path / "noted.yaml").write_text(
        "name: noted\nstep: 10 ms\nduration: 100 ms\nparticipants:\n"
        "  writer: {kind: fmu, path: notes.fmu, start: {text: Zange}}\n"
        f"  reader: {{kind: fmu, path: notes.fmu{host}}}\n"
        "connections:\n"
        "  - {source: writer.said, target: reader.text}\n"
        "  - {source: writer.mirrored, target: reader.frame}\n"
    )
    summary = launch(load(str(tmp_path / "noted.yaml")), record=tmp_path / "recording").run()
    assert (summary.state, summary.recording_complete) == ("done", True)
    recording = Recording(tmp_path / "recording")
    texts, frames = ([*recording[f"reader.{name}"].messages()] for name in ("said", "mirrored"))
    assert cast("StringMessage", texts[-1][1]).data == "Zange, step 10, step 10"
    assert cast("UInt8MultiArray", frames[-1][1]).data.tolist() == [10, 10]
    assert verify(recording, trust=True).same
