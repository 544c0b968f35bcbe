"""FMUs that end the simulation, and when their outputs are read, beside FMPy's `simulate_fmu`."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from engines.fmu import transfers
from engines.fmu.engine import FmuEngine, FmuParams
from hub.participant import Setup
from schemas.errors import SessionError
from tests.engines.fmu.driving import BALL, MS, SPRING, STAIR, Make, inputs_of, run
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

NO_STATE = {' canInterpolateInputs="true" canGetAndSetFMUstate="true" canSerializeFMUstate="true"': ""}


class TestEnds:
    def test_fmi2(self, make: Make) -> None:
        engine = make(STAIR, period=500 * MS, start={"last": 4})
        assert run(engine, 5, period=500 * MS)["counter"] == 3
        assert engine.ended == ""
        assert run(engine, 1, period=500 * MS, start=5)["counter"] == 4
        assert engine.ended == "the FMU asks to end the simulation at 3 s (fmi2Terminated)"

    def test_inside_a_step(self, make: Make) -> None:
        engine = make(STAIR, period=2000 * MS, step="100 ms", start={"last": 4})
        outputs = run(engine, 2, period=2000 * MS)
        assert (outputs["counter"], outputs["ticks"]) == (4, 30)
        assert "at 3 s" in engine.ended

    @pytest.mark.parametrize(
        ("edits", "how"),
        [
            (None, "terminateSimulation of fmi3UpdateDiscreteStates"),
            ({' hasEventMode="true"': ""}, "terminateSimulation of fmi3DoStep"),
        ],
    )
    def test_fmi3(self, make: Make, edits: dict[str, str] | None, how: str) -> None:
        bounce = math.sqrt(2 / 9.81)
        engine = make(BALL, start={"ends_at": 0.2}, edits=edits)
        if edits is None:  # with an event mode it ends at its first event
            outputs = run(engine, 460)
            assert (outputs["bounces"], engine.ended) == (
                1,
                f"the FMU asks to end the simulation at {bounce:.9g} s ({how})",
            )
        else:
            run(engine, 210)
            assert engine.ended == f"the FMU asks to end the simulation at 0.2 s ({how})"

    def test_at_a_discrete_input(self, make: Make) -> None:
        engine = make(BALL, start={"ends_at": 0.1})
        run(engine, 150)
        assert engine.ended == ""
        run(engine, 1, start=150, inputs=inputs_of(engine, frozen=1))
        assert "at 0.15 s" in engine.ended

    def test_the_last_outputs_are_held_and_the_hash_is_defined(self, make: Make) -> None:
        one, other = (make(STAIR, period=500 * MS, start={"last": 2}) for _ in range(2))
        assert run(one, 2, period=500 * MS) == run(one, 3, start=2, period=500 * MS)
        run(other, 5, period=500 * MS)
        assert one.state_hash() == other.state_hash()
        one.close()
        assert one.ended == ""

    def test_a_restored_state_goes_on(self, make: Make) -> None:
        engine = make(BALL, start={"ends_at": 0.2}, edits={' hasEventMode="true"': ""})
        run(engine, 100)
        saved = engine.save()
        first = run(engine, 110, start=100)
        assert engine.ended
        engine.restore(saved)
        assert engine.ended == ""
        assert run(engine, 110, start=100) == first
        assert engine.ended

    def test_before_it_begins(self, make: Make) -> None:
        with pytest.raises(SessionError, match="asks to end the simulation before it begins"):
            make(BALL, start={"ends_at": 0})

    def test_a_step_that_is_only_discarded_is_a_failure(self, make: Make) -> None:
        engine = make(SPRING, start={"fault": 2})
        with pytest.raises(SessionError, match="of which it got to 0 s"):
            run(engine, 1)
        assert engine.ended == ""


class TestReadings:
    """A value at a communication point is that after the step to it, and after the events there."""

    def test_fmi2_as_fmpy_reads_them(self, tmp_path: Path) -> None:
        from fmpy import simulate_fmu

        library = build.compile_library(STAIR, tmp_path, "-DALL_FUNCTIONS")
        path = build.pack(STAIR, library, tmp_path / "whole.fmu", NO_STATE)
        theirs = simulate_fmu(str(path), stop_time=8, output_interval=0.1)
        with FmuEngine("plant", FmuParams(path=path)) as engine:
            engine.configure(Setup(period_ns=100 * MS, directory=tmp_path))
            ours = [run(engine, 1, start=i, period=100 * MS) for i in range(80)]
        for name in ("counter", "ticks"):
            assert [row[name] for row in ours] == theirs[name][1:].tolist()

    def test_fmi3_is_the_later_of_the_two_that_fmpy_records(self, make: Make) -> None:
        """The ball falls 1 m in exactly the step of 0.5 s, and bounces there."""
        from fmpy import simulate_fmu

        engine = make(BALL, period=500 * MS, start={"g": -8})
        theirs = simulate_fmu(
            str(engine.params.path),
            stop_time=0.5,
            set_stop_time=False,
            output_interval=0.5,
            start_values={"g": -8},
            use_event_mode=True,
        )
        assert theirs["time"].tolist() == [0, 0.5, 0.5]
        assert theirs["bounces"].tolist() == [0, 0, 1]
        ours = run(engine, 1, period=500 * MS)
        assert (ours["bounces"], ours["v"]) == (1, theirs["v"][-1])

    def test_an_output_answers_a_discrete_input_at_the_end_of_the_step_that_it_enters(
        self, make: Make
    ) -> None:
        engine = make(BALL)
        assert run(engine, 5)["seen_frozen"] == 0
        assert run(engine, 1, start=5, inputs=inputs_of(engine, frozen=1))["seen_frozen"] == 1

    @pytest.mark.parametrize("period", [MS, 2 * MS, 100 * MS, 200 * MS])
    def test_steps_meet_in_every_bit(self, make: Make, monkeypatch: pytest.MonkeyPatch, period: int) -> None:
        monkeypatch.setattr(transfers, "compiled", None)
        engine = make(STAIR, period=period, start={"last": 10**6})
        calls: list[tuple[float, float]] = []
        instance = engine._instance
        assert instance is not None
        do_step = instance._do_step  # pyright: ignore[reportAttributeAccessIssue]

        def watched(component: int, time: float, step: float, flag: bool) -> int:
            calls.append((time, step))
            return do_step(component, time, step, flag)

        monkeypatch.setattr(instance, "_do_step", watched)
        run(engine, 3000, period=period)
        assert len(calls) == 3000
        assert all(t + h == after for (t, h), (after, _) in pairwise(calls))

    def test_steps_of_one_size_for_an_fmu_that_takes_no_others(
        self, make: Make, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(transfers, "compiled", None)
        engine = make(STAIR, edits={' canHandleVariableCommunicationStepSize="true"': ""})
        sizes: set[float] = set()
        monkeypatch.setattr(engine._instance, "_do_step", lambda c, t, h, flag: sizes.add(h) or 0)
        run(engine, 3000)
        assert sizes == {0.001}

    def test_an_fmu_that_adds_up_a_clock_of_its_own_is_ahead_by_one_step_of_it(self, tmp_path: Path) -> None:
        """As FMUs of 20-sim do; FMPy meets it as well, at other steps: the last bits of its times differ."""
        from fmpy import simulate_fmu

        library = build.compile_library(STAIR, tmp_path, "-DALL_FUNCTIONS", "-DADDING_CLOCK")
        path = build.pack(STAIR, library, tmp_path / "adding.fmu", NO_STATE)
        theirs = simulate_fmu(str(path), stop_time=8, output_interval=0.1)["ticks"][1:]
        with FmuEngine("plant", FmuParams(path=path)) as engine:
            engine.configure(Setup(period_ns=100 * MS, directory=tmp_path))
            ours = np.array([run(engine, 1, start=i, period=100 * MS)["ticks"] for i in range(80)])
        exact = np.arange(1, 81)
        assert set((ours - exact).tolist()) == set((theirs - exact).tolist()) == {0, 1}
        assert (ours != theirs).any()
