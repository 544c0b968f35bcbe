"""The way to a first run: scenarios listed, copied, recorded under a name of their own or over an old one."""

import sys
from itertools import chain
from pathlib import Path
from types import SimpleNamespace

import pytest

from hub.command_line.last_runs import last_wall_times, remember_run
from hub.planning.scenario_file import installed_scenarios, load, scenario_families
from hub.planning.scenario_source import read
from hub.recording.file_hashes import file_hashes
from hub.recording.recording import Recording

SCENARIO = "step: 1 ms\nduration: 3 ms\nparticipants:\n  robot: {kind: mujoco, arms: {PSM1: {}}}\n"


@pytest.fixture
def here(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short.yaml").write_text(f"name: short\n{SCENARIO}")
    return tmp_path


def test_every_installed_scenario_is_in_one_family():
    assert sorted(chain.from_iterable(scenario_families().values())) == sorted(installed_scenarios())


@pytest.fixture
def no_runs_yet(monkeypatch, tmp_path):
    for place in ("XDG_CONFIG_HOME", "APPDATA"):
        monkeypatch.setenv(place, str(tmp_path))


@pytest.mark.long
def test_a_listed_scenario_has_the_wall_time_of_its_last_whole_run(trocar, no_runs_yet):
    for state, wall_s in (("done", 31.4), ("stopped", 2.0)):
        remember_run("palpation", SimpleNamespace(state=state, ending=None, wall_time_s=wall_s))
    out = trocar("list")[1]
    line = next(line for line in out.splitlines() if line.startswith("  palpation "))
    assert "20 s (31 s)" in line
    assert "in brackets: wall time of your last run" in out


def test_a_file_of_last_runs_that_is_no_such_file_is_left_alone(no_runs_yet, tmp_path):
    assert last_wall_times() == {}
    (tmp_path / "trocar").mkdir()
    (tmp_path / "trocar" / "last_runs.json").write_text("{")
    assert last_wall_times() == {}


@pytest.mark.long
def test_they_are_listed_a_line_each(trocar, no_runs_yet):
    code, out, err = trocar("list")
    assert (code, err) == (0, "")
    lines = {line.split()[0]: line for line in out.splitlines() if line.startswith("  ")}
    assert lines.keys() == installed_scenarios().keys()
    assert "8 s" in lines["colon-grasp"]
    assert "routine" in lines["colon-grasp"]
    assert "expert" in lines["peg-board"]
    assert "simulated-touch, scripted" in lines["teleop"]
    assert "controller" not in out
    assert "A recorded hand palpates a soft block with PSM1" in lines["palpation"], "whole, in a file"
    assert lines["cart"].split()[1:4] == ["2", "s", "The"], "nothing leads it"
    assert "until Ctrl-C" in lines["ros"]
    assert trocar("run")[1] == out, "also where a name is missing"


def test_a_session_is_named_as_its_file():
    for name, file in installed_scenarios().items():
        assert read(file).tree["name"] == name


@pytest.mark.parametrize("name", ["palpation", "palpation-by-hand", "ros-mirror", "retraction", "tendon"])
def test_a_copy_of_a_scenario_is_complete(trocar, here, name):
    code, out, _ = trocar("new", "my-own", "--from", name)
    assert code == 0
    assert "trocar run my-own/my-own.yaml" in out
    copy, original = load("my-own/my-own.yaml"), load(name)
    assert copy.scenario.model_copy(update={"name": original.scenario.name}) == original.scenario
    assert copy.scenario.name == "my-own"
    home = original.source.directory
    read = {Path(file).relative_to(home) for file in file_hashes(original.params.values(), home)}
    copied = {file.relative_to(here / "my-own") for file in (here / "my-own").rglob("*") if file.is_file()}
    assert read <= copied


def test_a_copy_has_the_sources_of_an_fmu(trocar, here):
    trocar("new", "my-own", "--from", "tendon")
    assert (here / "my-own" / "data" / "tendon_drive" / "sources" / "tendon_drive.c").is_file()
    assert (here / "my-own" / "scenario.schema.json").is_file()


@pytest.mark.parametrize("name", ["1st", "short.yaml", "a b"])
def test_a_copy_over_something_or_without_a_name_is_refused(trocar, here, name):
    code, out, err = trocar("new", name)
    assert (code, out) == (2, "")
    assert "exists already" in err or "is no name" in " ".join(err.replace("│", " ").split())
    assert [entry.name for entry in here.iterdir()] == ["short.yaml"]


def test_recordings_without_a_name_have_the_date(trocar, here):
    for options in (["--record"], ["--record", "--one-host"]):
        code, out, err = trocar("run", "short.yaml", *options)
        assert code == 0, err
        assert "trocar view recordings/short-" in out
    for found in (here / "recordings").iterdir():
        assert Recording(found).scenario().name == "short"


def test_a_recording_is_overwritten_on_demand_alone(trocar, here):
    assert trocar("run", "short.yaml", "--record", "one")[0] == 0
    code, _, err = trocar("run", "short.yaml", "--record", "one")
    assert (code, "add --overwrite" in " ".join(err.replace("│", " ").split())) == (2, True)
    kept = (here / "one" / "one_0.mcap").read_bytes()
    assert trocar("run", "shirt.yaml", "--record", "one", "--overwrite")[0] == 2
    assert trocar("fork", "one", "--at", "1 ms", "--record", "one", "--overwrite")[0] == 2
    assert (here / "one" / "one_0.mcap").read_bytes() == kept, "an error deletes nothing"
    assert trocar("run", "short.yaml", "--record", "one", "--overwrite")[0] == 0
    (here / "one" / "notes.txt").write_text("mine")
    code, _, err = trocar("run", "short.yaml", "--record", "one", "--overwrite")
    assert (code, "something else than a recording" in " ".join(err.replace("│", " ").split())) == (2, True)
    assert (here / "one" / "notes.txt").read_text() == "mine"
    code, _, err = trocar("run", "short.yaml", "--overwrite")
    assert (code, "add that too" in " ".join(err.replace("│", " ").split())) == (2, True)


OWN = """\
step: 1 ms
duration: 5 ms
participants: {part: {kind: "part:Part"}}
"""
PART = """\
from trocar import Controller, Params


class Part(Controller):
    params_model, ports = Params, ()

    def configure(self, setup):
        return {}

    def step(self, t, h, inputs):
        return {}
"""


def test_a_class_of_ones_own_is_found_and_verified_as_the_command_says(trocar, here, monkeypatch):
    monkeypatch.setattr(sys, "path", [*sys.path])
    (here / "own.yaml").write_text(f"name: own\n{OWN}")
    code, _, err = trocar("check", "own.yaml")
    assert code != 0
    assert "state where part.py is: PYTHONPATH=DIR trocar" in err
    (here / "code").mkdir()
    (here / "code" / "part.py").write_text(PART)
    sys.path.append(str(here / "code"))
    code, out, _ = trocar("run", "own.yaml", "--record", "recorded")
    assert code == 0
    command = next(line for line in out.splitlines() if line.startswith("trocar verify"))
    assert command.split("  ")[0] == "trocar verify recorded --trust"
    assert trocar(*command.split("  ")[0].split()[1:])[0] == 0
