import json
import os
import select
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from time import sleep

import pyarrow.parquet as pq
import pytest

from hub.command_line.app import main
from learning.own_directory import MARKER, claim_directory
from learning.sweeps import sweep as sweep_module
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
    assert "3 of 3 trials, 1 failed" in always.stdout
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


def test_a_sweep_that_was_killed_before_its_settings_were_whole_begins(begun, command):
    words, directory = begun
    (directory / "trials").mkdir(parents=True)
    (directory / MARKER).write_text("sweep")
    (directory / "sweep.part").write_text('{"scenario"')
    assert command(*words)[0] == 0
    assert not (directory / "sweep.part").exists()


def test_a_cluster_that_is_not_there_is_named(begun, command):
    words, _ = begun
    code, said = command(*words, "--ray", "nowhere")
    assert (code, "no Ray cluster at 'nowhere': Invalid address" in said) == (1, True)


@pytest.mark.long
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


@pytest.fixture
def command(monkeypatch, capsys):
    """Run `trocar sweep` in this process; return its exit code and what it printed to stderr."""

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["trocar", "sweep", *map(str, words)])
        with pytest.raises(SystemExit) as left:
            main()
        return left.value.code, " ".join(capsys.readouterr().err.split())

    return run


@pytest.fixture
def begun(scenario, tmp_path, monkeypatch):
    """A sweep of two trials whose processes are not started: its words, and its directory."""

    def run_trial(scenario, overrides, recording):
        return {"attempts": 1, "state": "done", "error": None, "value": 1.0, "recording": recording}

    monkeypatch.setattr(sweep_module, "run_trial", run_trial)
    directory = tmp_path / "results"
    return (scenario, "--vary", "part.value=0,0.5", "-o", directory), directory


def test_no_link_is_followed_or_removed_through(begun, command, tmp_path):
    words, directory = begun
    assert command(*words)[0] == 0
    (directory / "trials/00001.json").unlink()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/letter.txt").write_text("dear")
    for place in ("trials/00001.part", "results.part", "results.png", "trials/00001"):
        (directory / place).unlink(missing_ok=True)
        (directory / place).symlink_to(tmp_path / "mine/letter.txt")
        assert command(*words) == (
            2,
            f"error: '{directory / place}' is a link, which we have not made: remove it",
        )
        (directory / place).unlink()
    shutil.move(directory / "trials", tmp_path / "trials")
    (directory / "trials").symlink_to(tmp_path / "trials")
    assert command(*words)[0] == 2
    assert (tmp_path / "mine/letter.txt").read_text() == "dear"


def test_a_directory_without_the_mark_is_left_alone(begun, command):
    words, directory = begun
    assert command(*words)[0] == 0
    (directory / MARKER).unlink()
    code, said = command(*words)
    assert (code, "has no file '.trocar' that says so" in said) == (2, True)


def test_of_two_sweeps_in_one_directory_the_second_is_refused(begun, command):
    words, directory = begun
    with claim_directory(directory, "sweep"):
        code, said = command(*words)
    assert (code, "another process uses" in said) == (2, True)
    assert command(*words)[0] == 0


@pytest.mark.parametrize(
    "row",
    ["", '{"error"', "[1]", "7", '{"error": 1}', "[" * 100_000, "\ud800", '{"value": 1}' + "x" * 10],
    ids=["empty", "cut", "list", "number", "odd", "deep", "bytes", "more"],
)
def test_a_damaged_row_is_named(begun, command, row):
    words, directory = begun
    assert command(*words)[0] == 0
    (directory / "trials/00001.json").write_bytes(row.encode("utf-8", "surrogatepass"))
    code, said = command(*words)
    assert (code, "00001.json'" in said, "delete it" in said) == (2, True, True)


@pytest.mark.long
@pytest.mark.parametrize(
    "values",
    [
        {"value": 10**400},
        {"value": "much"},
        {"value": True, "other": {"x": 1}},
        {"value": [1, {"a": 2}], "other": 3},
        {"part.value": {"a": {"b": 1}}, "trial": "x"},
        {"value": float("nan"), "more": float("inf")},
    ],
    ids=str,
)
def test_odd_numbers_in_a_row_end_as_text(begun, command, values):
    words, directory = begun
    assert command(*words)[0] == 0
    (directory / "trials/00001.json").write_text(json.dumps({"error": None, **values}))
    assert command(*words)[0] == 0
    rows = _rows(directory)
    assert [row["part.value"] for row in rows] == [0.0, 0.5]
    assert [row["trial"] for row in rows] == [0, 1]


PARENT = """
import sys
from learning.sweeps.trial import run_trial

run_trial(sys.argv[1], ["part.value=0", "part.forever=true"], None)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere the input of the trial ends")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP])
def test_a_trial_ends_with_its_sweep(scenario, number):
    with subprocess.Popen([sys.executable, "-c", PARENT, scenario]) as parent:
        while not (children := _children(parent.pid)):
            assert parent.poll() is None
            sleep(0.01)
        (child,) = children
        handle = os.pidfd_open(child)
        parent.send_signal(number)
        parent.wait()
    try:
        assert select.select([handle], [], [], 100.0)[0], "the trial runs on"
    finally:
        os.close(handle)


def _children(number):
    return [int(each) for each in Path(f"/proc/{number}/task/{number}/children").read_text().split()]
