"""Clocks of FMI 3.0 in co-simulation with event mode."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from engines.fmu.engine import FmuEngine, FmuParams
from hub.command_line.app import app as command_line
from hub.participant import Inputs, Outputs, Setup, Stepped, event_out
from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from hub.verify import verify
from schemas.errors import ScenarioError, SessionError
from schemas.ros import EmptyMessage
from tests.engines.fmu.driving import BALL, MS, Make, inputs_of, ports
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

METRONOME = "metronome"
NO_SPLIT = {'canHandleVariableCommunicationStepSize="true" ': ""}


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build.compile_library(METRONOME, tmp_path_factory.mktemp(METRONOME))


@pytest.fixture
def metronome(library: Path, tmp_path: Path) -> Iterator[Any]:
    """Makes a configured engine of the metronome."""
    engines: list[FmuEngine] = []

    def make(period: int = 10 * MS, edits: dict[str, str] | None = None, **params: Any) -> FmuEngine:
        path = build.pack(METRONOME, library, tmp_path / f"{len(engines)}.fmu", edits)
        engines.append(FmuEngine("plant", FmuParams(path=path, **params)))
        engines[-1].configure(Setup(period_ns=period, directory=tmp_path))
        return engines[-1]

    yield make
    for engine in engines:
        engine.close()


def values(outputs: Any, *names: str) -> tuple[float, ...]:
    return tuple(float(outputs[name][0]) for name in names)


def hitting(engine: FmuEngine, count: int = 1, **given: Any) -> Inputs:
    inputs = inputs_of(engine, **given)
    inputs._events = {"hit": (EmptyMessage(),) * count}
    return inputs


def without_bell(outputs: Any) -> dict[str, list[float]]:
    return {name: value.tolist() for name, value in outputs.items() if name != "bell"}


def test_triggered_clocks_are_event_ports_and_timed_ones_none(metronome: Any) -> None:
    found = ports(metronome())
    assert {"beat", "echo"}.isdisjoint(found)
    assert (found["hit"].causality, found["hit"].variability) == ("input", "event")
    assert (found["bell"].causality, found["bell"].variability) == ("output", "event")
    assert "a hit on the table" in found["hit"].description


@pytest.mark.parametrize("period", [10, 30, 200])
def test_clocks_of_known_times_tick_inside_steps(metronome: Any, period: int) -> None:
    """Beats are at 0.05, 0.15, ...; an echo follows each second one by 0.025 s."""
    engine = metronome(period * MS)
    outputs = {}
    for k in range(1200 // period):
        outputs = engine.step(k * period * MS, period * MS, inputs_of(engine, level=3))
        end = (k + 1) * period
        beats = (end + 50) // 100
        echoes = sum(1 for n in range(2, 14, 2) if 100 * n - 50 + 25 <= end)
        assert values(outputs, "beats", "echoes") == (beats, echoes), end
    assert values(outputs, "sampled") == (6.0,)


def test_a_clocked_output_holds_its_value_between_ticks(metronome: Any) -> None:
    engine = metronome()
    outputs = {}
    for k in range(5):
        outputs = engine.step(k * 10 * MS, 10 * MS, inputs_of(engine, level=1))
    assert values(outputs, "beats", "sampled") == (1, 2)
    outputs = engine.step(50 * MS, 10 * MS, inputs_of(engine, level=7))
    assert values(outputs, "sampled") == (2,)


def test_messages_tick_triggered_clocks_and_output_clocks_send_messages(metronome: Any) -> None:
    engine = metronome()
    assert engine.step(0, 10 * MS, hitting(engine))["bell"] == ()
    assert len(engine.step(10 * MS, 10 * MS, hitting(engine))["bell"]) == 1
    outputs = engine.step(20 * MS, 10 * MS, hitting(engine, 3))
    assert (values(outputs, "hits"), len(outputs["bell"])) == ((5,), 1)
    assert engine.step(30 * MS, 10 * MS, inputs_of(engine))["bell"] == ()


def test_a_saved_state_has_ticks_and_held_outputs(metronome: Any) -> None:
    engine = metronome()

    def go_on() -> dict[str, list[float]]:
        outputs = {}
        for k in range(26, 60):
            outputs = engine.step(k * 10 * MS, 10 * MS, inputs_of(engine, level=k))
        return without_bell(outputs)

    for k in range(26):
        engine.step(k * 10 * MS, 10 * MS, hitting(engine, level=k))
    saved, hashed = engine.save(), engine.state_hash()
    expected = go_on()
    engine.restore(saved)
    assert engine.state_hash() == hashed
    held = without_bell(engine._outputs)
    assert (held["beats"], held["hits"], held["sampled"]) == ([3.0], [26.0], [48.0])
    assert go_on() == expected


class Tapper(Stepped):
    """Taps in each fourth step."""

    ports = (event_out("tap", EmptyMessage),)

    def configure(self, setup: Setup) -> Outputs:
        self._period = setup.period_ns
        return {"tap": ()}

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        return {"tap": (EmptyMessage(),) if t // self._period % 4 == 0 else ()}

    def state_hash(self) -> int:
        return 0

    def close(self) -> None:
        """Nothing to close."""


@pytest.mark.long
@pytest.mark.parametrize("host", ["", ", host: fmu"])
def test_clocks_tick_in_a_session_that_verifies(library: Path, tmp_path: Path, host: str) -> None:
    """Taps tick the first metronome, whose bell ticks the second; both beat by themselves."""
    build.pack(METRONOME, library, tmp_path / "metronome.fmu")
    (tmp_path / "beats.yaml").write_text(
        "name: beats\nstep: 10 ms\nduration: 800 ms\nparticipants:\n"
        f'  tapper: {{kind: "{__name__}:Tapper"}}\n'
        "  first: {kind: fmu, path: metronome.fmu}\n"
        f"  second: {{kind: fmu, path: metronome.fmu{host}}}\n"
        "connections: [tapper.tap -> first.hit, first.bell -> second.hit]\n"
    )
    checked = CliRunner().invoke(command_line, ["check", str(tmp_path / "beats.yaml")])
    assert "FMI 3.0 co-simulation: events at their time, inside a step" in checked.output
    summary = launch(load(str(tmp_path / "beats.yaml")), record=tmp_path / "recording").run()
    assert summary.state == "done"
    recording = Recording(tmp_path / "recording")
    assert len(recording["tapper.tap"]) == 20
    assert len(recording["first.bell"]) == 10
    ends = {name: recording[name].values[-1, 0] for name in ("first.hits", "second.hits", "second.beats")}
    assert ends == {"first.hits": 20, "second.hits": 10, "second.beats": 8}
    assert verify(recording, trust=True).same


class TestRefusals:
    def test_a_step_that_cannot_be_split(self, metronome: Any) -> None:
        engine = metronome(10 * MS, edits=NO_SPLIT)
        for k in range(17):
            engine.step(k * 10 * MS, 10 * MS, inputs_of(engine))
        with pytest.raises(SessionError, match=r"ticks at 0\.175 s, inside the step to 0\.18 s.*choose a"):
            engine.step(170 * MS, 10 * MS, inputs_of(engine))
        engine = metronome(10 * MS, edits=NO_SPLIT, step="5 ms")
        for k in range(18):
            outputs = engine.step(k * 10 * MS, 10 * MS, inputs_of(engine))
        assert values(outputs, "echoes") == (1,)

    @pytest.mark.parametrize(
        ("interval", "expected"), [("soon", "times that are no numbers"), ("0", "is not above 0: tick")]
    )
    def test_times(self, make: Make, interval: str, expected: str) -> None:
        clock = (
            f'<Clock name="tick" intervalVariability="fixed" intervalDecimal="{interval}" valueReference="30"'
            ' causality="input"/>'
        )
        with pytest.raises(ScenarioError, match=expected):
            _ = make(BALL, period=0, edits={'<Binary name="image"': clock + '<Binary name="image"'}).ports

    def test_timed_clocks_without_an_event_mode(self, make: Make) -> None:
        clock = '<Clock name="tick" intervalVariability="fixed" valueReference="30" causality="input"/>'
        edits = {'<Binary name="image"': clock + '<Binary name="image"', ' hasEventMode="true"': ""}
        with pytest.raises(ScenarioError, match=r"time-based input clocks \(tick\), and no event mode"):
            _ = make(BALL, period=0, edits=edits).ports
