"""FMUs for model exchange, integrated by CVode."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from engines.fmu.engine import FmuEngine, FmuParams
from hub.command_line.app import app as command_line
from hub.participant import Setup
from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from hub.verify import verify
from schemas.errors import ScenarioError, SessionError
from tests.engines.fmu.driving import MS, SPRING, inputs_of, run
from tests.engines.fmu.driving import Make as MakeOther
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

HOPPER = "hopper"
FALL_S = math.sqrt(2 / 9.81)
IMPACT = 9.81 * FALL_S
BOTH = pytest.mark.parametrize("fmi", [2, 3])
ERROR_BELOW_LOW, DISCARD_BELOW_LOW, END_AT_TICK = 1, 2, 3
"""Values of the parameter `fault`."""
Make = Callable[..., FmuEngine]


@pytest.fixture(scope="session")
def hoppers(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """Libraries by version of FMI."""
    return {
        fmi: build.compile_library(HOPPER, tmp_path_factory.mktemp(f"hopper{fmi}"), f"-DFMI={fmi}")
        for fmi in (2, 3)
    }


def pack(fmi: int, library: Path, path: Path) -> Path:
    folder, name = {2: ("linux64", "modelDescription.xml"), 3: ("x86_64-linux", "modelDescription3.xml")}[fmi]
    return build.pack(HOPPER, library, path, folder=folder, description=name)


@pytest.fixture
def hop(hoppers: dict[int, Path], tmp_path: Path) -> Iterator[Make]:
    """Makes a configured engine of the hopper."""
    engines: list[FmuEngine] = []

    def make(fmi: int, period: int = MS, **params: Any) -> FmuEngine:
        path = pack(fmi, hoppers[fmi], tmp_path / f"hopper{len(engines)}.fmu")
        engines.append(FmuEngine("plant", FmuParams(path=path, **params)))
        engines[-1].configure(Setup(period_ns=period, directory=tmp_path))
        return engines[-1]

    yield make
    for engine in engines:
        engine.close()


@BOTH
def test_a_fall_is_exact(hop: Make, fmi: int) -> None:
    outputs = run(hop(fmi, period=10 * MS), 40, period=10 * MS)
    assert outputs["h"] == pytest.approx(1 - 9.81 * 0.4**2 / 2, abs=5e-6)
    assert outputs["v"] == pytest.approx(-9.81 * 0.4, abs=5e-6)
    assert outputs["completed"] > 0


@BOTH
def test_zeros_of_event_indicators_and_time_events_are_met_inside_a_step(hop: Make, fmi: int) -> None:
    """The step of 100 ms meets the ground at 0.4515 s."""
    outputs = run(hop(fmi, period=100 * MS), 8, period=100 * MS)
    rest = 0.8 - FALL_S
    assert (outputs["bounces"], outputs["ticks"]) == (1, 3)
    assert outputs["h"] == pytest.approx(IMPACT / 2 * rest - 9.81 * rest**2 / 2, abs=1e-6)
    assert outputs["v"] == pytest.approx(IMPACT / 2 - 9.81 * rest, abs=1e-6)


@BOTH
def test_an_event_at_the_end_of_a_step_belongs_to_it(hop: Make, fmi: int) -> None:
    engine = hop(fmi, period=250 * MS)
    assert run(engine, 1, period=250 * MS)["ticks"] == 1
    assert run(engine, 1, period=250 * MS, start=1)["ticks"] == 2


@BOTH
def test_inputs_and_tunable_parameters(hop: Make, fmi: int) -> None:
    engine = hop(fmi, tunable={"g": None})
    outputs = run(engine, 100, inputs=inputs_of(engine, u=9.81))
    assert outputs["h"] == pytest.approx(1.0, abs=1e-9)
    outputs = run(engine, 100, start=100, inputs=inputs_of(engine, u=9.81, g=19.81))
    assert outputs["v"] == pytest.approx(-1.0, abs=1e-6)
    held = run(engine, 100, start=200, inputs=inputs_of(engine, held=1))
    assert (held["was_held"], held["h"]) == (1, pytest.approx(outputs["h"], abs=1e-9))


@BOTH
def test_a_saved_state_is_that_of_the_fmu(hop: Make, fmi: int) -> None:
    engine, other = hop(fmi), hop(fmi)
    run(engine, 300)
    saved = engine.save()
    expected = run(engine, 300, start=300), engine.state_hash()
    engine.restore(saved)
    assert (run(engine, 300, start=300), engine.state_hash()) == expected
    other.restore(saved)
    assert (run(other, 300, start=300), other.state_hash()) == expected
    assert expected[0]["bounces"] == 1


class TestFailures:
    @BOTH
    def test_an_error_of_the_equations_ends_the_session(self, hop: Make, fmi: int) -> None:
        engine = hop(fmi, start={"low": 0.5, "fault": ERROR_BELOW_LOW})
        with pytest.raises(SessionError, match=r"Get\w*Derivatives returned 'error'"):
            run(engine, 500)

    @pytest.mark.long
    @BOTH
    def test_a_discard_lets_the_solver_try_shorter_steps_first(self, hop: Make, fmi: int) -> None:
        engine = hop(fmi, start={"low": 0.5, "fault": DISCARD_BELOW_LOW})
        with pytest.raises(SessionError, match=r"CVode cannot integrate the FMU from 0\.3"):
            run(engine, 500)

    @BOTH
    def test_the_fmu_may_end_the_session(self, hop: Make, fmi: int) -> None:
        engine = hop(fmi, start={"fault": END_AT_TICK})
        run(engine, 900)
        assert "the FMU asks to end the simulation at 0.75 s (terminateSimulation of" in engine.ended

    def test_no_model_exchange(self, make: MakeOther) -> None:
        with pytest.raises(ScenarioError, match=r"is for co-simulation only; leave 'solver' out"):
            _ = make(SPRING, period=0, solver="cvode").ports


@pytest.mark.long
@pytest.mark.parametrize("host", ["", ", host: fmu"])
def test_a_session_verifies(hoppers: dict[int, Path], tmp_path: Path, host: str) -> None:
    pack(3, hoppers[3], tmp_path / "hopper.fmu")
    path = tmp_path / "hop.yaml"
    path.write_text(
        "name: hop\nstep: 10 ms\nduration: 1 s\n"
        f"participants: {{plant: {{kind: fmu, path: hopper.fmu, solver: cvode{host}}}}}\n"
    )
    checked = CliRunner().invoke(command_line, ["check", str(path)])
    assert "model exchange, integrated by CVode (SUNDIALS), relative tolerance 1e-08" in checked.output
    summary = launch(load(str(path)), record=tmp_path / "recording").run()
    assert summary.state == "done"
    assert verify(Recording(tmp_path / "recording"), trust=True).same
