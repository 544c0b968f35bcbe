"""The console of a surgeon over the whole cart, as far as it takes to feel the table; and the same bits again
from its recording.
"""

import json
import subprocess
import sys


def trocar(*arguments):
    done = subprocess.run(
        [sys.executable, "-P", "-m", "hub.command_line", *arguments],
        capture_output=True,
        text=True,
        check=False,
    )
    assert not done.returncode, done.stderr
    return json.loads(done.stdout)


def test_both_hands_lead_their_arms_and_the_right_one_feels_the_table(tmp_path):
    images = "participants.endoscope.images=none"
    run = trocar(
        "run",
        "teleop",
        "--one-host",
        "--json",
        "--set",
        "duration=2.6 s",
        "--set",
        images,
        "--record",
        str(tmp_path / "bag"),
    )
    assert 0.5 < run["right_hand_force_n"] < 1.981  # at most 60 % of what a Touch can
    assert run["dropped_messages"] == 0
    assert trocar("verify", str(tmp_path / "bag"), "--json")["same"]
