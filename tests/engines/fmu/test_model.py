"""What a modelDescription.xml may have wrong, and what cannot be done with it here."""

from __future__ import annotations

import logging

import pytest

from schemas.errors import ScenarioError
from tests.engines.fmu.driving import BALL, SPRING, Make, ports, run
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

UNIT_OF_NOTHING = {'<Real start="0.1"/>': '<Real displayUnit="N" start="0.1"/>'}
START_OF_WORDS = {'<Real unit="N" start="0"/>': '<Real unit="N" start="nothing"/>'}


def error_of(make: Make, model: str, edits: dict[str, str]) -> str:
    with pytest.raises(ScenarioError) as caught:
        _ = make(model, period=0, edits=edits).ports
    return str(caught.value)


class TestStrict:
    @pytest.mark.parametrize(
        ("edits", "expected"),
        [
            (UNIT_OF_NOTHING, "variable 'd' (line 24) has the display unit 'N' and no unit"),
            (START_OF_WORDS, "input 'F' (line 18) has the start value 'nothing', no number"),
        ],
    )
    def test_a_variable_that_breaks_a_rule_is_named_with_its_line(
        self, make: Make, caplog: pytest.LogCaptureFixture, edits: dict[str, str], expected: str
    ) -> None:
        error = error_of(make, SPRING, edits)
        assert expected in error
        assert "'strict: false'" in error
        engine = make(SPRING, edits=edits, strict=False)
        assert any(expected in line for line in caplog.messages)
        assert set(ports(engine)) == set(ports(make(SPRING)))

    def test_it_runs_as_fmpy_runs_it_without_validation(self, make: Make) -> None:
        from fmpy import simulate_fmu

        engine = make(SPRING, edits=UNIT_OF_NOTHING, strict=False, start={"x": 1})
        path = str(engine.params.path)
        with pytest.raises(KeyError):
            simulate_fmu(path)
        theirs = simulate_fmu(
            path,
            validate=False,
            stop_time=0.01,
            set_stop_time=False,
            output_interval=0.001,
            start_values={"x": 1},
        )
        assert run(engine, 10)["x"] == pytest.approx(theirs["x"][-1], abs=1e-15)

    def test_an_input_without_a_start_value_must_be_connected(self, make: Make) -> None:
        assert ports(make(SPRING, period=0, edits=START_OF_WORDS, strict=False))["F"].start is None

    def test_what_fmpy_cannot_read_either(self, make: Make) -> None:
        edits = {
            'name="d" valueReference="6" causality="parameter"': 'name="d" valueReference="6" causality="x"'
        }
        for strict in (True, False):
            with pytest.raises(ScenarioError, match=r"breaks a rule of FMI.*\(line 24\)"):
                _ = make(SPRING, period=0, edits=edits, strict=strict).ports

    @pytest.mark.parametrize("edits", [{'name="e" ': 'name="" '}, {'<Alias name="height"': "<Alias"}])
    def test_a_variable_without_a_name(self, make: Make, edits: dict[str, str]) -> None:
        with pytest.raises(ScenarioError, match=r"a variable \(line \d+\) has no name"):
            _ = make(BALL, period=0, edits=edits, strict=False).ports

    def test_values_of_any_length_are_quoted_in_part(self, make: Make) -> None:
        for model, edits in (
            (SPRING, {'causality="parameter"': f'causality="{"x" * 30_000}"'}),
            (SPRING, {'fmiVersion="2.0"': f'fmiVersion="{"x" * 30_000}"'}),
            (SPRING, {'<Real unit="N" start="0"/>': f'<Real unit="N" start="{"x" * 30_000}"/>'}),
        ):
            assert len(error_of(make, model, edits)) < 2_000

    def test_rules_that_change_nothing_are_logged_with_the_line(
        self, make: Make, caplog: pytest.LogCaptureFixture
    ) -> None:
        with caplog.at_level(logging.WARNING):
            make(SPRING, edits={'<Unit name="N">': '<Unit name="kN">'})
        assert any('variable "F" (line 18) is not defined' in line for line in caplog.messages)

    def test_an_array_that_would_fill_the_memory(self, make: Make) -> None:
        error = error_of(make, BALL, {'<Dimension start="2"/>': '<Dimension start="2000000000"/>'})
        assert "'state' (line 25) are no numbers whose product is at most 1000000" in error
