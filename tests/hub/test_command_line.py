import json
import sys
from importlib.metadata import version

import pytest

from hub.command_line import main
from hub.scenario_file import installed_scenarios

SCENARIO = """\
name: swinging
step: 1 ms
participants:
  one: {kind: pendulum, length: 80 mm}
  two: {kind: pendulum, length: 0.5}
connections:
  - one.angle -> two.gaol
"""


@pytest.fixture
def trocar(monkeypatch, capsys):
    """Run `trocar ...` and return exit code, stdout and stderr."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["trocar", *map(str, arguments)])
        with pytest.raises(SystemExit) as left:
            main()
        out, err = capsys.readouterr()
        return left.value.code or 0, out, err

    return run


def test_version_and_help(trocar):
    assert trocar("--version") == (0, version("trocar") + "\n", "")
    code, out, _ = trocar("--help")
    assert code == 0
    assert "0 done" in out


def test_bad_usage_is_exit_code_2(trocar):
    for arguments in (["chek"], ["check"], ["check", "palpation", "--no-such-option"], ["recover", "no/such/recording"]):
        code, out, err = trocar(*arguments)
        assert (code, out) == (2, "")
        assert "Usage" in err


def test_a_bad_scenario_is_exit_code_2_and_a_clean_message(trocar, pendulum, tmp_path):
    file = tmp_path / "session.yaml"
    file.write_text(SCENARIO)
    code, out, err = trocar("check", file)
    assert (code, out) == (2, "")
    assert f"{file}:7:5: connections.0" in err
    assert "Did you mean 'goal'?" in err
    assert "Traceback" not in err


def test_check_shows_the_wiring_of_a_good_scenario(trocar, pendulum, tmp_path):
    file = tmp_path / "session.yaml"
    file.write_text(SCENARIO.replace("gaol", "goal"))
    code, out, _ = trocar("check", file, "--json")
    assert code == 0
    assert {(link["source"], link["target"]) for link in json.loads(out)["links"]} == {("one", "two")}
    code, out, err = trocar("check", file, "--set", "step=2 ms")
    assert (code, out) == (0, "")
    assert "valid" in err


@pytest.mark.parametrize("name", sorted(installed_scenarios()))
def test_every_installed_scenario_is_valid(trocar, name):
    code, _, err = trocar("check", name)
    assert code == 0, err


def test_every_installed_scenario_names_its_schema():
    for file in installed_scenarios().values():
        assert file.read_text().splitlines()[0] == "# yaml-language-server: $schema=scenario.schema.json"


def test_doctor_as_json(trocar):
    code, out, _ = trocar("doctor", "--json")
    report = json.loads(out)
    assert code == 0
    assert report["works"]
    found = {finding["name"]: finding for finding in report["findings"]}
    assert {"Python", "Zenoh", "mujoco", "bullet", "fmu", "EGL", "OpenHaptics", "LibOVR", "OpenXR", "ROS 1", "ROS 2"} <= set(found)
    assert all(finding["works"] or finding["remedy"] for finding in found.values())
    assert "works" in trocar("doctor")[1]


def test_ls_where_no_hub_is(trocar):
    assert trocar("ls", "--connect", "tcp/127.0.0.1:1", "--json") == (0, "[]\n", "")
