import logging
import subprocess
import sys
from pathlib import Path

import pytest

import trocar


def test_a_session_is_run_read_and_verified(tmp_path: Path) -> None:
    seen: list[int] = []
    summary = trocar.run(
        "table",
        set={"duration": "40 ms", "participants.teleop.scale": 0.5},
        record=tmp_path / "table",
        one_host=True,
        progress=lambda progress: seen.append(progress.step),
    )
    assert (summary.steps, summary.state, summary.recording_complete) == (40, "done", True)
    assert seen
    recording = trocar.Recording(tmp_path / "table")
    assert recording.scenario().participants["teleop"].params["scale"] == 0.5
    assert recording["robot.PSM1/measured_js"]["position"].shape == (41, 6)
    assert trocar.verify(recording).same
    assert trocar.verify(str(tmp_path / "table")).hashes > 0


def test_values_are_set_as_on_the_command_line() -> None:
    loaded = trocar.load_scenario(
        "table", set={"step": "2 ms", "participants.robot.looks": True, "window": 2}
    )
    assert (loaded.scenario.step, loaded.scenario.window) == (2_000_000, 2)
    assert loaded.scenario.participants["robot"].params["looks"] is True


def test_a_wrong_value_is_located() -> None:
    with pytest.raises(trocar.TrocarError, match=r"--set participants\.teleop\.scale=\[1, 2\]"):
        trocar.load_scenario("table", set={"participants.teleop.scale": [1, 2]})
    with pytest.raises(trocar.TrocarError, match=r"table\.yaml:\d+:\d+: .*no participant|--set"):
        trocar.run("table", set={"order": ["robot"]})


@pytest.mark.long
def test_numpy_that_was_imported_first_is_reported(tmp_path: Path) -> None:
    script = (
        "import numpy, logging; logging.basicConfig(); import trocar\n"
        "trocar.run('table', set={'duration': '4 ms'}, one_host=True)"
    )
    environment = {"PATH": "/usr/bin"}
    command = [sys.executable, "-P", "-c", script]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    assert "numpy was imported before trocar.run" in done.stderr
    assert "OPENBLAS_NUM_THREADS=1" in done.stderr
    command[-1] = script.replace("numpy, ", "")
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    assert "numpy" not in done.stderr


def test_this_process_computes_as_the_hosts_do(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        trocar.run("table", set={"duration": "4 ms"}, one_host=True)
    assert not caplog.records
