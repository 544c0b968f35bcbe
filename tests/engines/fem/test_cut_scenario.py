"""The scenario `cut` in small, up to its first bite: the same bits in one process, in two, and again."""

import json
import subprocess
import sys

import pytest

import trocar


def run(*more):
    settings = ("duration=4.2 s", "participants.tissue.organs.strip.nodes=200", *more)
    command = [sys.executable, "-P", "-m", "hub.command_line", "run", "cut", "--json"]
    command += [part for setting in settings for part in ("--set", setting)]
    return command


@pytest.mark.long
def test_scissors_cut_a_strip_that_forceps_hold(tmp_path):
    commands = (
        [*run(), "--one-host", "--record", str(tmp_path / "cut")],
        run("participants.tissue.host=apart"),
    )
    one, two = (
        json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
        for command in commands
    )
    assert 5e-6 < one["area"] < 30e-6
    assert one["pull_n"] > 0.3
    assert abs(one["energy_residual_j"]) < 1e-3
    assert one["state_hash"] == two["state_hash"]
    recording = trocar.Recording(tmp_path / "cut")
    events = [event for _, event in recording["tissue.strip/events"].messages()]
    assert sorted((event.kind, event.instrument) for event in events) == [("bleeding", ""), ("cut", "PSM1")]
    assert one["blood"] > 0.0
    assert trocar.verify(tmp_path / "cut").same
