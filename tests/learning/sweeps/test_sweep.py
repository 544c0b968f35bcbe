import json
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from hub.command_line.app import main
from learning.sweeps.sweep import Sweep
from learning.sweeps.variation import parse
from schemas.errors import ScenarioError
from trocar import Recording

SWEEP = [sys.executable, "-m", "trocar", "sweep"]


def _sweep(*words):
    return subprocess.run([*SWEEP, *map(str, words)], capture_output=True, text=True, check=False)


def _rows(directory):
    return pq.read_table(directory / "results.parquet").to_pylist()


@pytest.mark.alone
def test_a_table_of_all_trials(scenario, tmp_path):
    output = tmp_path / "results"
    done = _sweep(
        scenario, "--vary", "part.value=0.1..0.3:2", "--set", "duration=2 ms", "--repeat", 2, "-o", output
    )
    assert done.returncode == 0, done.stderr
    rows = _rows(output)
    assert [(row["part.value"], row["value"], row["repetition"]) for row in rows] == [
        (value, value, repetition) for value in (0.1, 0.3) for repetition in (0, 1)
    ]
    assert {(row["state"], row["steps"], row["attempts"], row["error"]) for row in rows} == {
        ("done", 2, 1, None)
    }
    for first, second in zip(rows[::2], rows[1::2], strict=True):
        assert first["state_hash"] == second["state_hash"]
    assert Recording(Path(rows[3]["recording"]))["part.value"].values[-1].tolist() == [0.3]
    assert (output / "results.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.alone
def test_it_goes_on_where_it_stopped(scenario, tmp_path):
    sweep = Sweep(str(scenario), (parse("part.value=0,0.5"),), tmp_path / "results", repeat=2, recorded=False)
    sweep.open()
    trials = sweep.run(1)
    next(trials)
    trials.close()
    assert len(sweep.rows()) == 1
    (tmp_path / "results" / "trials" / "00002.part").write_text("{")  # what a sudden end leaves
    again = Sweep(str(scenario), (parse("part.value=0,0.5"),), tmp_path / "results", repeat=2, recorded=False)
    again.open()
    assert len(again.pending()) == 3
    assert len(list(again.run(2))) == 3
    assert [row["part.value"] for row in again.rows()] == [0, 0, 0.5, 0.5]


@pytest.mark.alone
def test_a_killed_trial_is_repeated_once_and_the_table_is_whole(scenario, tmp_path):
    output, mark = tmp_path / "results", tmp_path / "mark"
    once = _sweep(scenario, "--vary", "part.value=0,2", "--set", f"part.mark={mark}", "-o", output)
    assert once.returncode == 0, once.stderr
    assert [(row["state"], row["attempts"]) for row in _rows(output)] == [("done", 1), ("done", 2)]
    always = _sweep(scenario, "--vary", "part.value=0,2,0.5", "-o", tmp_path / "always")
    assert always.returncode == 1
    assert "3 of 3 trials, 1 failed" in always.stderr
    rows = _rows(tmp_path / "always")
    assert [(row["state"], row["attempts"], row["error"]) for row in rows] == [
        ("done", 1, None),
        ("died", 2, "killed by signal 9"),
        ("done", 1, None),
    ]
    assert [row["value"] for row in rows] == [0.0, None, 0.5]


@pytest.mark.parametrize(
    ("vary", "says"),
    [
        (["nobody.value=1,2"], "there is no 'nobody' here"),
        (["part.valu=1,2"], "valu"),
        (["part.value=1,much"], "part.value"),
        (["part.value=1,2", "part.value=3,4"], "'part.value' is varied twice"),
        (["part.value=1..2"], "is not a range"),
    ],
)
def test_bad_values_are_refused_before_anything_runs(scenario, tmp_path, monkeypatch, capsys, vary, says):
    varied = [word for each in vary for word in ("--vary", each)]
    command = ["trocar", "sweep", str(scenario), *varied, "-o", str(tmp_path / "results")]
    monkeypatch.setattr(sys, "argv", command)
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 2
    assert says in capsys.readouterr().err
    assert not (tmp_path / "results").exists()


def test_another_directory_is_left_alone(scenario, tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "letter.txt").touch()
    sweep = Sweep(str(scenario), (parse("part.value=0,1"),), tmp_path / "full")
    with pytest.raises(ScenarioError, match="holds something else"):
        sweep.open()
    Sweep(str(scenario), (parse("part.value=0,1"),), tmp_path / "results").open()
    assert json.loads((tmp_path / "results" / "sweep.json").read_text())["vary"] == {"part.value": [0, 1]}
    with pytest.raises(ScenarioError, match="holds another sweep"):
        Sweep(str(scenario), (parse("part.value=0,2"),), tmp_path / "results").open()


def test_an_edited_scenario_is_noticed(scenario, tmp_path):
    def sweep():
        return Sweep(str(scenario), (parse("part.value=0,0.5"),), tmp_path / "results", recorded=False)

    first = sweep()
    first.open()
    trials = first.run(1)
    next(trials)
    trials.close()
    assert first.rows()[0]["scenario_hash"] == first.scenario_hash
    text = scenario.read_text()
    scenario.write_text(f"# a comment changes nothing\n{text}")
    sweep().open()
    scenario.write_text(text.replace("3 ms", "4 ms"))
    with pytest.raises(ScenarioError, match="has changed since the sweep in"):
        sweep().open()
