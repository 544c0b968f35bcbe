from __future__ import annotations

import logging
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from engines.fmu.engine import FmuEngine, FmuParams
from hub.participant import Setup
from schemas.errors import MissingExtraError, ScenarioError, SessionError, StateError
from tests.engines.fmu.driving import BALL, MS, SPRING, STAIR, Make, inputs_of, ports, run
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)


class TestPorts:
    def test_the_test_fmus_are_valid(self, make: Make) -> None:
        from fmpy.validation import validate_fmu

        for model in (SPRING, BALL, STAIR):
            assert validate_fmu(str(make(model, period=0).params.path)) == []

    def test_fmi2_variables_with_unit_start_and_type(self, make: Make) -> None:
        found = ports(make(SPRING, period=0))
        assert set(found) == {
            "F",
            "x",
            "v",
            "body/a_x5B_1_x5D_",
            "x_mm",
            "steps",
            "stage",
            "locked",
            "seen_locked",
            "note",
        }
        assert (found["F"].causality, found["F"].unit, found["F"].start) == ("input", "N", (0.0,))
        # unit of the declared type
        assert (found["x"].causality, found["x"].unit, found["x"].start) == ("output", "m", None)
        assert found["x_mm"].unit == "mm"  # as the FMU declares it
        assert found["body/a_x5B_1_x5D_"].unit == "m/s2"
        assert found["locked"].start == (0.0,)
        assert found.pop("note").type == "std_msgs/msg/String"
        assert {port.type for port in found.values()} == {"std_msgs/msg/Float64"}
        assert "force on the mass" in found["F"].description

    def test_fmi3_arrays_and_structural_parameters(self, make: Make) -> None:
        found = ports(make(BALL, period=0))
        assert (found["u"].type, found["u"].size, found["u"].start) == (
            "std_msgs/msg/Float64MultiArray",
            3,
            (0.0, 0.0, 0.0),
        )
        assert found["state"].size == 2
        assert "height" not in found  # an alias of h
        assert ports(make(BALL, period=0, start={"size": 5}))["u"].size == 5

    def test_a_start_value_of_an_input_is_that_of_its_port(self, make: Make) -> None:
        found = ports(make(BALL, period=0, start={"u": [1, 2, 3], "frozen": True}))
        assert (found["u"].start, found["frozen"].start) == ((1.0, 2.0, 3.0), (1.0,))

    def test_a_relative_path_starts_at_the_scenario(self, tmp_path: Path) -> None:
        params = FmuParams.model_validate({"path": "parts/a.fmu"}, context={"directory": tmp_path})
        assert params.path == tmp_path / "parts" / "a.fmu"


class TestBadFmus:
    def error(self, engine: FmuEngine) -> ScenarioError:
        with pytest.raises(ScenarioError) as caught:
            _ = engine.ports
        return caught.value

    def test_missing_file(self, tmp_path: Path) -> None:
        error = self.error(FmuEngine("plant", FmuParams(path=tmp_path / "none.fmu")))
        assert "does not exist" in str(error)
        assert error.path == ("participants", "plant", "path")

    @pytest.mark.parametrize("content", [b"", b"not a zip file", b"PK\x05\x06" + bytes(18)])
    def test_no_fmu(self, tmp_path: Path, content: bytes) -> None:
        path = tmp_path / "bad.fmu"
        path.write_bytes(content)
        assert "is no FMI 2.0 or 3.0 FMU" in str(self.error(FmuEngine("plant", FmuParams(path=path))))

    @pytest.mark.parametrize(
        ("model", "edits", "expected"),
        [
            (
                BALL,
                {
                    "<CoSimulation ": "<ScheduledExecution ",
                    'canHandleVariableCommunicationStepSize="true" ': "",
                    ' hasEventMode="true" mightReturnEarlyFromDoStep="true"': "",
                },
                "is for scheduled execution only; export it for co-simulation or model exchange",
            ),
            (SPRING, {'fmiVersion="2.0"': 'fmiVersion="4.0"'}, "Unsupported FMI version"),
            (SPRING, {"<ModelVariables>": "<Model"}, "XMLSyntaxError"),
        ],
    )
    def test_what_cannot_be_co_simulated(
        self, make: Make, model: str, edits: dict[str, str], expected: str
    ) -> None:
        assert expected in str(self.error(make(model, period=0, edits=edits)))

    def test_no_binary_for_this_platform(self, libraries: dict[str, Path], tmp_path: Path) -> None:
        path = build.pack(SPRING, libraries[SPRING], tmp_path / "win.fmu", folder="win64")
        assert "no binary for this platform, linux64; it has: win64" in str(
            self.error(FmuEngine("plant", FmuParams(path=path)))
        )
        path = build.pack(SPRING, None, tmp_path / "none.fmu")
        assert "it has: none" in str(self.error(FmuEngine("plant", FmuParams(path=path))))

    def test_a_library_that_does_not_load_leaves_the_directory_alone(self, tmp_path: Path) -> None:
        library = tmp_path / f"{SPRING}.so"
        library.write_bytes(b"no library")
        engine = FmuEngine("plant", FmuParams(path=build.pack(SPRING, library, tmp_path / "bad.fmu")))
        before = Path.cwd()
        with pytest.raises(ScenarioError, match="cannot be loaded"):
            engine.configure(Setup(period_ns=MS, directory=tmp_path))
        assert Path.cwd() == before
        engine.close()

    @pytest.mark.parametrize("model", [SPRING, BALL])
    def test_an_fmu_that_refuses_to_be_instantiated(self, make: Make, model: str) -> None:
        with pytest.raises(SessionError, match="cannot be instantiated"):
            make(model, edits={"{trocar-": "{other-"})

    def test_rules_of_the_schema_are_logged_and_not_enforced(
        self, make: Make, caplog: pytest.LogCaptureFixture
    ) -> None:
        engine = make(SPRING, edits={'<Unit name="N">': '<Unit name="kN">'})
        assert ports(engine)["F"].unit == "N"
        assert any("breaks rules of FMI" in line for line in caplog.messages)

    def test_without_fmpy(self, make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
        engine = make(SPRING, period=0)
        monkeypatch.setitem(sys.modules, "fmpy", None)
        with pytest.raises(MissingExtraError, match=r"pip install 'trocar\[fmu\]'"):
            _ = engine.ports


class TestStart:
    @pytest.mark.parametrize(
        ("model", "start", "expected"),
        [
            (SPRING, {"mm": 1}, "Did you mean 'm'"),
            (SPRING, {"v_max": 1}, "has no variable 'v_max'"),
            (SPRING, {"steps": 1}, "has no variable 'steps' that takes a start value"),
            (SPRING, {"m": "1 m"}, "not a quantity in kg"),
            (SPRING, {"m": True}, "takes numbers"),
            (SPRING, {"m": float("nan")}, "takes numbers from"),
            (SPRING, {"m": [1, 2]}, "takes 1 numbers, not 2"),
            (SPRING, {"m": {"value": 1}}, "takes numbers"),
            (SPRING, {"m": None}, "takes numbers"),
            (SPRING, {"fault": 0.5}, "whole numbers"),
            (SPRING, {"locked": 3}, "true or false"),
            (SPRING, {"label": 3}, "takes a text"),
            (BALL, {"u": [1, 2]}, "takes 3 numbers, not 2"),
            (BALL, {"big": 2**53 + 1}, "no exact double"),
            (BALL, {"gain": 1e39}, "takes numbers from"),
            (BALL, {"size": "many"}, "not a quantity"),
        ],
    )
    def test_a_value_that_does_not_fit_is_refused_before_anything_starts(
        self, make: Make, model: str, start: dict[str, Any], expected: str
    ) -> None:
        with pytest.raises(ScenarioError) as caught:
            _ = make(model, period=0, start=start).ports
        assert expected in str(caught.value)
        assert caught.value.path == ("participants", "plant", "start", *start)

    def test_values_are_taken_in_the_unit_of_the_variable(self, make: Make, tmp_path: Path) -> None:
        engine = make(SPRING, period=0, start={"x": "5 cm", "m": "500 g", "stage": 2, "locked": True})
        outputs = engine.configure(Setup(period_ns=MS, directory=tmp_path))
        assert outputs["x"] == pytest.approx(0.05)
        assert outputs["x_mm"] == pytest.approx(50)
        assert outputs["body/a_x5B_1_x5D_"] == pytest.approx(-10 * 0.05 / 0.5)
        assert outputs["seen_locked"] == 1

    def test_arrays_and_structural_parameters(self, make: Make) -> None:
        engine = make(BALL, start={"size": 4, "u": 2, "gain": 0.5, "big": 2**53})
        outputs = engine.step(0, MS, inputs_of(engine, u=[1, 2, 3, 4]))
        assert np.array_equal(outputs["y"], [0.5, 1, 1.5, 2])
        assert outputs["big_out"] == 2**53

    def test_a_start_value_that_the_fmu_refuses(self, make: Make) -> None:
        with pytest.raises(SessionError, match="told to refuse"):
            make(SPRING, start={"fault": 6})
        with pytest.raises(SessionError, match=r"start value of 'size'.*cannot set SIZE"):
            make(BALL, start={"size": 9})

    def test_a_step_that_does_not_divide_the_period(self, make: Make) -> None:
        with pytest.raises(ScenarioError, match="does not divide"):
            make(SPRING, step="0.3 ms")


class TestStep:
    def test_free_vibration_is_exact(self, make: Make) -> None:
        outputs = run(make(SPRING, start={"x": 1, "m": 2, "c": 50, "d": 0.4}), 500)
        x, v = expm(np.array([[0, 1], [-50 / 2, -0.4 / 2]]) * 0.5) @ [1, 0]
        assert outputs["x"] == pytest.approx(x, abs=1e-9)
        assert outputs["v"] == pytest.approx(v, abs=1e-9)
        assert outputs["steps"] == 500

    @pytest.mark.parametrize(
        ("interpolates", "step", "tolerance"),
        [(True, None, 1e-9), (False, "1 ms", 1e-6), (False, None, 1e-4)],
    )
    def test_a_force_that_is_extrapolated_inside_the_step(
        self, make: Make, interpolates: bool, step: str | None, tolerance: float
    ) -> None:
        edits = None if interpolates else {' canInterpolateInputs="true"': ""}
        engine = make(SPRING, period=10 * MS, step=step, edits=edits)
        for i in range(30):
            outputs = engine.step(i * 10 * MS, 10 * MS, inputs_of(engine, {"F": 20.0}, F=20 * i * 0.01))
        truth = solve_ivp(
            lambda t, y: [y[1], 20 * t - 10 * y[0] - 0.1 * y[1]], (0, 0.3), [0, 0], rtol=1e-11, atol=1e-13
        ).y[:, -1]
        assert outputs["x"] == pytest.approx(truth[0], abs=tolerance)
        held = make(SPRING, period=10 * MS, edits=edits)
        for i in range(30):
            outputs = held.step(i * 10 * MS, 10 * MS, inputs_of(held, F=20 * i * 0.01))
        assert abs(outputs["x"][0] - truth[0]) > 1e-3

    def test_a_slope_does_not_outlive_its_step(self, make: Make) -> None:
        one, other = make(SPRING), make(SPRING, edits={' canInterpolateInputs="true"': ""})
        one.step(0, MS, inputs_of(one, {"F": 0.0}, F=1))
        other.step(0, MS, inputs_of(other, F=1))
        assert run(one, 5, start=1) == run(other, 5, start=1)

    def test_sub_steps(self, make: Make) -> None:
        engine = make(SPRING, period=10 * MS, step="2 ms")
        assert run(engine, 3, period=10 * MS)["steps"] == 15

    def test_integers_and_booleans(self, make: Make) -> None:
        engine = make(SPRING, start={"x": 1})
        outputs = run(engine, 3, inputs=inputs_of(engine, locked=1, stage=2))
        assert (outputs["x"], outputs["steps"], outputs["seen_locked"]) == (1, 3, 1)
        with pytest.raises(SessionError, match="input 'locked' takes whole numbers from 0 to 1, not 2"):
            run(engine, 1, start=3, inputs=inputs_of(engine, locked=2))
        with pytest.raises(SessionError, match=r"input 'stage' takes whole numbers from .*, not 1\.5"):
            run(engine, 1, start=3, inputs=inputs_of(engine, stage=1.5))

    def test_tolerance_reaches_the_fmu(self, make: Make) -> None:
        make(SPRING, tolerance=1e-6)
        make(BALL, tolerance=1e-6)

    def test_closed_loop_with_a_controller(self, make: Make) -> None:
        """The mass held at 20 mm by a PD controller in Python, against the same loop integrated in one."""
        engine = make(SPRING, start={"d": 2})
        outputs: Any = {"x": np.zeros(1), "v": np.zeros(1)}
        for i in range(1500):
            force = 400 * (0.02 - float(outputs["x"][0])) - 30 * float(outputs["v"][0])
            outputs = engine.step(i * MS, MS, inputs_of(engine, F=force))
        truth = solve_ivp(
            lambda t, y: [y[1], 400 * (0.02 - y[0]) - 32 * y[1] - 10 * y[0]],
            (0, 1.5),
            [0, 0],
            rtol=1e-9,
            atol=1e-12,
        ).y[:, -1]
        assert outputs["x"] == pytest.approx(truth[0], rel=1e-4)

    def test_not_configured(self, make: Make) -> None:
        with pytest.raises(SessionError, match="not configured"):
            run(make(SPRING, period=0), 1)


class TestEvents:
    """Of FMI 3. The test FMU refuses every call in the wrong mode, and steps over scheduled events."""

    G, E = 9.81, 0.7

    def height(self, time: float) -> tuple[float, int]:
        """Exact height and number of bounces of a ball dropped from 1 m."""
        bounce, speed, count = math.sqrt(2 / self.G), math.sqrt(2 * self.G), 0
        if time < bounce:
            return 1 - self.G * time**2 / 2, 0
        while True:
            speed, count = self.E * speed, count + 1
            flight = 2 * speed / self.G
            if time < bounce + flight:
                t = time - bounce
                return speed * t - self.G * t**2 / 2, count
            bounce += flight

    @pytest.mark.parametrize(
        "edits", [None, {' hasEventMode="true"': ""}, {' canHandleVariableCommunicationStepSize="true"': ""}]
    )
    @pytest.mark.parametrize("period", [MS, 50 * MS, 500 * MS])
    def test_no_bounce_is_lost_or_late(self, make: Make, period: int, edits: dict[str, str] | None) -> None:
        outputs = run(make(BALL, period=period, edits=edits), 2000 * MS // period, period=period)
        height, bounces = self.height(2.0)
        assert outputs["bounces"] == bounces == 4
        assert outputs["h"] == pytest.approx(height, abs=1e-9)

    def test_scheduled_event_inside_a_step(self, make: Make) -> None:
        engine = make(BALL, period=100 * MS, start={"kick_time": 0.0503, "kick": 1})
        outputs = run(engine, 1, period=100 * MS)
        assert outputs["v"] == pytest.approx(1 - self.G * 0.1)
        assert outputs["h"] == pytest.approx(1 - self.G * 0.1**2 / 2 + 1 * (0.1 - 0.0503))

    @pytest.mark.parametrize("time", [0.0, 0.1, 0.2])
    def test_scheduled_event_at_a_communication_point(self, make: Make, time: float) -> None:
        outputs = run(make(BALL, period=100 * MS, start={"kick_time": time, "kick": 1}), 2, period=100 * MS)
        assert outputs["v"] == pytest.approx(1 - self.G * 0.2)

    def test_discrete_inputs_are_set_in_event_mode(self, make: Make) -> None:
        engine = make(BALL, start={"frozen": True})
        frozen = run(engine, 10)
        assert (frozen["h"], frozen["seen_frozen"]) == (1, 1)
        outputs = run(engine, 10, start=10, inputs=inputs_of(engine, frozen=0))
        assert outputs["h"] == pytest.approx(1 - self.G * 0.01**2 / 2)
        assert run(engine, 10, start=20, inputs=inputs_of(engine, frozen=1))["h"] == outputs["h"]

    def test_discrete_states_that_do_not_settle(self, make: Make) -> None:
        with pytest.raises(SessionError, match="do not settle"):
            make(BALL, start={"stay": True})


class TestFaults:
    @pytest.mark.parametrize(
        ("fault", "expected"),
        [
            (1, r"output 'v' is \[nan\], expected finite numbers, at 0\.001 s"),
            (
                2,
                (
                    r"fmi2DoStep returned 'discard' for the step from 0 s to 0\.001 s, of which it got to 0"
                    r" s; the FMU reports: told to discard \(0\)"
                ),
            ),
            (
                3,
                (
                    r"fmi2DoStep returned 'error' for the step from 0 s to 0\.001 s; the FMU reports: told to"
                    r" fail \(0\)"
                ),
            ),
            (4, r"fmi2SetReal returned 'discard' for 'F'"),
            (5, r"fmi2DoStep returned 'fatal'.*told to die"),
        ],
    )
    def test_the_error_says_what_and_when(self, make: Make, fault: int, expected: str) -> None:
        engine = make(SPRING, start={"fault": fault})
        with pytest.raises(SessionError, match=expected):
            run(engine, 1)

    def test_messages_go_to_logging_and_not_to_the_terminal(
        self, make: Make, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
    ) -> None:
        with caplog.at_level(logging.DEBUG, "engines.fmu.log"):
            engine = make(SPRING, start={"fault": 3})
            with pytest.raises(SessionError):
                run(engine, 1)
            make(SPRING).close()
        assert (
            "engines.fmu.log",
            logging.ERROR,
            "plant: logStatus: told to fail (0)",
        ) in caplog.record_tuples
        assert ("engines.fmu.log", logging.DEBUG, "plant: logStatus: terminated (0)") in caplog.record_tuples
        assert capfd.readouterr() == ("", "")


class TestState:
    @pytest.mark.parametrize("model", [SPRING, BALL])
    def test_equal_runs_have_equal_hashes(self, make: Make, model: str) -> None:
        one, other = make(model), make(model)
        for i in range(600):
            run(one, 1, start=i)
            run(other, 1, start=i)
            assert one.state_hash() == other.state_hash()
        assert make(model).state_hash() != one.state_hash()

    @pytest.mark.parametrize("model", [SPRING, BALL])
    def test_restore_is_exact(self, make: Make, model: str, tmp_path: Path) -> None:
        engine = make(model, start={"kick_time": 0.52, "kick": 1} if model == BALL else {"x": 1})
        run(engine, 440)
        saved, at_save = engine.save(), engine.state_hash()
        first = run(engine, 200, start=440)
        hashed = engine.state_hash()
        engine.restore(saved)
        assert engine.state_hash() == at_save
        assert run(engine, 200, start=440) == first
        assert engine.state_hash() == hashed
        fresh = make(model, start={"kick_time": 0.52, "kick": 1} if model == BALL else {"x": 1})
        fresh.restore(saved)
        assert run(fresh, 200, start=440) == first
        assert fresh.state_hash() == hashed

    @pytest.mark.parametrize("missing", ["canGetAndSetFMUstate", "canSerializeFMUstate"])
    def test_an_fmu_that_cannot_save(self, make: Make, missing: str) -> None:
        edits = {f' {missing}="true"': ""}
        engine, other = make(SPRING, edits=edits), make(SPRING, edits=edits)
        for attempt in (engine.save, lambda: engine.restore(b"")):
            with pytest.raises(StateError, match=missing):
                attempt()
        before = engine.state_hash()
        assert run(engine, 10) == run(other, 10)
        assert engine.state_hash() == other.state_hash() != before

    @pytest.mark.parametrize("model", [SPRING, BALL])
    @pytest.mark.parametrize("state", [b"", b"abc", bytes(1000)])
    def test_bytes_that_are_no_state(self, make: Make, model: str, state: bytes) -> None:
        with pytest.raises((StateError, SessionError), match=r"(no|not a) state of"):
            make(model).restore(state)

    def test_addresses_in_a_state_stay_out_of_the_hash(self, tmp_path: Path) -> None:
        library = build.compile_library(SPRING, tmp_path, "-DWITH_ADDRESS")
        params = FmuParams(path=build.pack(SPRING, library, tmp_path / "address.fmu"))
        with FmuEngine("one", params) as one, FmuEngine("other", params) as other:
            for engine in (one, other):
                engine.configure(Setup(period_ns=MS, directory=tmp_path))
                run(engine, 5)
            assert one.save() != other.save()
            assert one.state_hash() == other.state_hash()


class TestClose:
    def test_nothing_is_left(self, make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        scratch = tmp_path / "scratch"
        scratch.mkdir()
        monkeypatch.setattr("tempfile.tempdir", str(scratch))
        engine = make(SPRING)
        assert len(list(scratch.iterdir())) == 1
        engine.close()
        engine.close()
        assert list(scratch.iterdir()) == []
        with pytest.raises(SessionError, match="cannot be instantiated"):
            make(BALL, edits={"{trocar-": "{other-"})
        assert list(scratch.iterdir()) == []

    def test_it_can_be_configured_again(self, make: Make, tmp_path: Path) -> None:
        engine = make(SPRING, start={"x": 1})
        first = run(engine, 5)
        engine.configure(Setup(period_ns=MS, directory=tmp_path))
        assert run(engine, 5) == first
