"""Tunable parameters that change while a session runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import trocar
from hub.recording.recording import Recording
from hub.verify import verify
from schemas.errors import ScenarioError
from tests.engines.fmu.driving import BALL, SPRING, Make, inputs_of, ports, run
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

TUNABLE_M = {
    'name="m" valueReference="4" causality="parameter" variability="fixed"': (
        'name="m" valueReference="4" causality="parameter" variability="tunable"'
    ),
    '<Real unit="kg" start="1"': '<Real unit="kg" min="0.5" max="2" start="1"',
}


def error_of(
    make: Make, model: str, tunable: object, edits: dict[str, str] | None = None, **params: object
) -> str:
    with pytest.raises(ScenarioError) as caught:
        _ = make(model, period=0, edits=edits, tunable=tunable, **params).ports
    assert caught.value.path is not None
    assert caught.value.path[:3] == ("participants", "plant", "tunable")
    return str(caught.value)


def test_it_is_a_port_with_limits(make: Make) -> None:
    port = ports(make(BALL, period=0, tunable={"e": (0, 1)}))["e"]
    assert (port.causality, port.start, port.limits) == ("input", (0.7,), (0.0, 1.0))
    port = ports(make(BALL, period=0, tunable={"e": (0, 1)}, start={"e": 0.5}))["e"]
    assert port.start == (0.5,)
    assert "e" not in ports(make(BALL, period=0))


def test_the_fmu_may_state_the_limits(make: Make) -> None:
    assert ports(make(SPRING, period=0, edits=TUNABLE_M, tunable={"m": None}))["m"].limits == (0.5, 2.0)


@pytest.mark.parametrize("edits", [None, {' hasEventMode="true"': ""}])
def test_a_change_acts_from_its_step_on(make: Make, edits: dict[str, str] | None) -> None:
    changed = make(BALL, tunable={"e": (0, 1)}, edits=edits)
    other = make(BALL, start={"e": 0.2}, edits=edits)
    assert run(changed, 300) == run(other, 300)  # before the first bounce
    after = run(changed, 300, start=300, inputs=inputs_of(changed, e=0.2))
    assert after == run(other, 300, start=300)
    assert after["bounces"] >= 1


def test_fmi2(make: Make) -> None:
    engine = make(SPRING, edits=TUNABLE_M, tunable={"m": None}, start={"x": 0.1})
    light, heavy = make(SPRING, start={"x": 0.1}), make(SPRING, start={"x": 0.1, "m": 2})
    assert run(engine, 50) == run(light, 50) != run(heavy, 50)
    moved = run(engine, 50, start=50, inputs=inputs_of(engine, m=2))
    assert moved != run(light, 50, start=50)
    again = run(engine, 50, start=100, inputs=inputs_of(engine, m=7))  # a connection beyond the limits
    assert again["x"] != moved["x"]


@pytest.mark.parametrize("model", [SPRING, BALL])
def test_a_saved_state_brings_its_value_back(make: Make, model: str) -> None:
    name, value, edits = ("m", 2.0, TUNABLE_M) if model == SPRING else ("e", 0.3, None)
    limits = None if model == SPRING else (0, 1)
    engine = make(model, tunable={name: limits}, edits=edits)
    run(engine, 400)
    saved = engine.save()
    expected = run(engine, 400, start=400)
    engine.restore(saved)
    run(engine, 200, start=400, inputs=inputs_of(engine, **{name: value}))
    engine.restore(saved)
    assert run(engine, 400, start=400) == expected


class TestRefusals:
    def test_what_may_not_change(self, make: Make) -> None:
        assert "there is no tunable parameter 'g'. Known: e" in error_of(make, BALL, {"g": (0, 1)})

    def test_limits(self, make: Make) -> None:
        assert "states no limits of 'e'" in error_of(make, BALL, {"e": None})
        assert "the limits of 'e' are 1 and 0: least, then greatest" in error_of(make, BALL, {"e": (1, 0)})
        assert "'e' starts at 0.7, outside 0 to 0.5" in error_of(make, BALL, {"e": (0, 0.5)})
        assert "'e' takes numbers, not True" in error_of(make, BALL, {"e": (True, 1)})


def test_a_session_records_the_change_and_verifies(libraries: dict[str, Path], tmp_path: Path) -> None:
    build.pack(BALL, libraries[BALL], tmp_path / "ball.fmu")
    file = tmp_path / "tuned.yaml"
    file.write_text(
        "name: tuned\nstep: 10 ms\nduration: 1 s\n"
        "participants: {ball: {kind: fmu, path: ball.fmu, tunable: {e: [0, 1]}}}\n"
    )
    hashes: list[int] = []
    with trocar.SteppedSession(trocar.load_scenario(file)) as session:
        for value in (0.7, 0.1):
            session.restart(tmp_path / str(value))
            session.advance(100, {"ball.e": np.array([value])})
            hashes.append(session.state_hash)
        session.restart()
    assert hashes[0] != hashes[1]
    for value in (0.7, 0.1):
        assert verify(Recording(tmp_path / str(value)), trust=True).same
