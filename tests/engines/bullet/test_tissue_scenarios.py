"""A scenario in which an instrument takes hold of an organ, as far as it takes to see that it does."""

import json
import subprocess
import sys

import pytest


@pytest.mark.long
def test_the_liver_is_lifted_and_held():
    run = [
        sys.executable,
        "-P",
        "-m",
        "hub.command_line",
        "run",
        "retraction",
        "--one-host",
        "--json",
        "--set",
        "duration=3.6 s",
    ]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
    result = json.loads(done.stdout)
    assert result["lift_m"] > 0.015
    assert result["hold_s"] > 0.4
    assert result["sag_m"] < 1e-3
    assert abs(result["energy_residual_j"]) < 1e-4
