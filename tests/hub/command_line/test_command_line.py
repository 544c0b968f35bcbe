import json
import signal
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import pytest

from hub import doctor as examination
from hub.command_line.display import RunProgress, latency_rows
from hub.planning.scenario_file import installed_scenarios, load
from tests.hub.authorities import free_endpoint

SCENARIO = """\
name: swinging
step: 1 ms
participants:
  one: {kind: pendulum, length: 80 mm}
  two: {kind: pendulum, length: 0.5}
connections:
  - one.angle -> two.gaol
"""


REMOTE = """\
name: away
step: 1 ms
duration: 50 ms
participants:
  robot: {kind: mujoco, host: remote, arms: {PSM1: {}}}
"""


def wait_for(look: Callable[[], Any]) -> Any:
    """Return the first answer of `look` that holds something."""
    for _ in range(50):
        if found := look():
            return found
    raise TimeoutError("nothing came")


def test_version_and_help(trocar):
    assert trocar("--version") == (0, version("trocar") + "\n", "")
    code, out, _ = trocar("--help")
    assert code == 0
    assert "0 done" in out
    assert "trocar list" in trocar()[1]


def test_certificates_are_results(trocar, tmp_path):
    for words in (["init", "hub.lab"], ["issue", "stylus"], ["show"]):
        code, out, err = trocar("certs", *words, "--dir", tmp_path)
        assert (code, err) == (0, "")
        assert "stylus" in out or "hub.lab" in out


def test_bad_usage_is_exit_code_2(trocar):
    for arguments in (
        ["chek"],
        ["check"],
        ["check", "palpation", "--no-such-option"],
        ["recover", "no/such/recording"],
    ):
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
    assert {(link["source"], link["target"]) for link in json.loads(out)["connections"]} == {("one", "two")}
    code, out, err = trocar("check", file, "--set", "step=2 ms")
    assert (code, err) == (0, "")
    assert "valid" in out
    assert " 1 input, 1 of them from one" in out
    assert "<- goal" not in out
    assert "<- goal" in trocar("check", file, "--ports")[1]


@pytest.mark.long
def test_every_installed_scenario_is_valid(trocar):
    for name in sorted(installed_scenarios()):
        code, _, err = trocar("check", name)
        assert code == 0, f"{name}: {err}"


@pytest.mark.long
def test_a_log_that_is_no_terminal_has_one_line_for_each_message():
    old = ["--set", "participants.stylus.link.delay=3 ms"]
    command = [sys.executable, "-P", "-m", "hub.command_line", "check", "palpation", *old]
    ran = subprocess.run(command, capture_output=True, text=True, check=True)
    (warning,) = [line for line in ran.stderr.splitlines() if "link" in line and "WARNING" in line]
    assert warning.endswith("'link' is now 'network_link'; this release still accepts the old name")
    assert ran.stderr.count("network_link") == 1


def test_every_installed_scenario_names_its_schema():
    for file in installed_scenarios().values():
        assert file.read_text().splitlines()[0] == "# yaml-language-server: $schema=scenario.schema.json"


@pytest.mark.long
def test_doctor(trocar, monkeypatch):
    findings = examination.examine()  # once: it tries every OpenGL in a process of its own
    monkeypatch.setattr(examination, "examine", lambda: findings)
    code, out, _ = trocar("doctor", "--json")
    report = json.loads(out)
    assert code == 0
    assert report["works"]
    found = {finding["name"]: finding for finding in report["findings"]}
    assert {
        "Python",
        "Zenoh",
        "mujoco",
        "bullet",
        "fmu",
        "OpenGL",
        "OpenHaptics",
        "LibOVR",
        "OpenXR",
        "ROS 1",
        "ROS 2",
    } <= set(found)
    assert all(finding["works"] or finding["remedy"] for finding in found.values())
    shown, everything = trocar("doctor")[1], trocar("doctor", "--all")[1]
    assert f"runs all {len(installed_scenarios())} scenarios" in shown
    assert "works" not in shown
    assert len(everything.splitlines()) > len(found) > len(shown.splitlines())


def test_ls_where_no_hub_is(trocar):
    assert trocar("ls", "--connect", "tcp/127.0.0.1:1", "--json") == (0, "[]\n", "")


@pytest.fixture
def swinging(pendulum, tmp_path):
    file = tmp_path / "session.yaml"
    file.write_text(
        SCENARIO.replace("gaol", "goal")
        + "duration: 20 ms\nmeasure:\n  last_angle: {kind: final, of: two.angle, live: true}\n"
    )
    return file


def test_run_prints_its_summary_as_json_on_stdout_alone(trocar, swinging, tmp_path):
    code, out, err = trocar("run", swinging, "--json", "--record", tmp_path / "recording")
    assert code == 0, err
    summary = json.loads(out)
    assert {
        "steps": 20,
        "sim_time_s": 0.02,
        "late_steps": 0,
        "recording": str(tmp_path / "recording"),
        "state": "done",
    }.items() <= summary.items()
    assert {"last_angle", "wall_time_s", "real_time_factor", "state_hash", "energy_residual_j"} <= set(
        summary
    )
    assert trocar("run", swinging, "--record", tmp_path / "recording")[0] == 2
    code, out, err = trocar("verify", tmp_path / "recording", "--json")
    assert code == 0, err
    assert {"same": True, "steps": 20, "hashes": 40}.items() <= json.loads(out).items()


def test_run_shows_people_a_summary_on_stdout(trocar, swinging):
    code, out, _ = trocar("run", swinging, "--pace", "realtime")
    assert code == 0
    first, second = out.splitlines()[:2]
    assert first == "session done"
    assert second.startswith("0.02 s simulated in ")
    assert "grant to state" not in out
    everything = trocar("run", swinging, "--all")[1]
    assert {"steps 20", "late steps 0"} <= {" ".join(line.split()) for line in everything.splitlines()}
    assert "grant to state" not in everything, "no device takes part"


def test_a_failing_participant_is_exit_code_1_and_a_clean_message(trocar, swinging):
    code, out, err = trocar("run", swinging, "--set", "participants.two.length=101")
    assert (code, out) == (1, "")
    assert "participant 'two' failed at step 0: ArithmeticError: the rope is torn" in err


def test_run_with_a_profile_shows_where_the_time_goes(trocar, swinging):
    code, out, err = trocar("run", swinging, "--profile", "--json")
    assert code == 0, err
    profile = json.loads(out)["profile"]
    assert profile["core_s_per_sim_s"] >= profile["by_taker"]["participant one"] > 0.0
    assert profile["step"]["hub"]["participant two"]["wall_s"] > 0.0
    assert (profile["late_causes"], profile["worst_steps"]) == ({}, [])
    assert json.loads(trocar("run", swinging, "--json")[1])["profile"] is None
    text = trocar("run", swinging, "--profile")[1]
    assert "core-seconds per simulated second" in text
    assert "participant two" in text
    assert "late because of" not in text


@pytest.mark.long
def test_a_participant_hosted_elsewhere_and_ls(tmp_path):
    (tmp_path / "session.yaml").write_text(REMOTE)
    endpoint = free_endpoint()
    command = [sys.executable, "-P", "-m", "hub.command_line"]
    hub = subprocess.Popen(
        [*command, "run", "session.yaml", "--listen", endpoint, "--json"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        text=True,
    )
    with hub:
        rows = wait_for(
            lambda: json.loads(
                subprocess.check_output([*command, "ls", "--json", "--connect", endpoint], text=True)
            )
        )
        assert rows[0]["session"] == "away"
        assert (rows[0]["endpoints"], rows[0]["pid"]) == ([endpoint], hub.pid)
        shown = subprocess.check_output([*command, "ls"], text=True)  # which is not given the port
        assert endpoint in shown
        assert (
            rows[0]["participants"][0].items()
            >= {
                "name": "robot",
                "role": "engine",
                "host": "remote/robot",
                "step": -1,
            }.items()
        )
        if hasattr(signal, "SIGSTOP"):
            hub.send_signal(signal.SIGSTOP)
            stopped = subprocess.run(
                [*command, "ls", "--connect", endpoint], capture_output=True, text=True, check=True
            )
            hub.send_signal(signal.SIGCONT)
            assert f"process {hub.pid}, does not answer" in " ".join(stopped.stderr.split())
        engine = subprocess.run(
            [*command, "engine", "robot", "--connect", endpoint, "--session", "away"],
            cwd=tmp_path,
            timeout=60,
            check=False,
        )
        out, _ = hub.communicate(timeout=60)
    assert (engine.returncode, hub.returncode) == (0, 0)
    assert json.loads(out)["steps"] == 50


def test_of_a_device_with_many_streams_the_slowest_is_shown():
    row = {"count": 5, "p50_s": 0.001, "p99_s": 0.002, "largest_s": 0.003}
    streams = {f"console.PSM1/{index}": row | {"p99_s": 1e-3 * index} for index in range(9)}
    rows = list(
        latency_rows(
            {"grant to state": {"all participants": row}, "device to grant": {"hand.pose": row} | streams}
        )
    )
    assert [stream for _, stream, *_ in rows] == [
        "all participants",
        "hand.pose",
        "console, the slowest of 9",
    ]
    assert rows[-1][4] == "8.000 ms"


def test_the_progress_line_has_the_name_as_it_was_typed(capsys):
    with RunProgress(load("colon-grasp", []).scenario, "colon-grasp"):
        pass
    assert capsys.readouterr().err.startswith("colon-grasp ")
