"""The limit of open files: a session runs within it, or says at its start what it needs."""

import json
import subprocess
import sys
from itertools import pairwise

import pytest

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limit")

RUN = 'ulimit {limit} && exec "$0" -P -m hub.command_line run session.yaml --record bag --json'
COUNT = 40


def limited(directory, limit):
    """Run a chain of engines in two hosts under a limit of the shell's `ulimit`."""
    names = [f"p{index}" for index in range(COUNT)]
    scenario = {
        "name": "chain",
        "step": "1 ms",
        "duration": "2 ms",
        "participants": {
            name: {"kind": "toys:Mixer", "host": f"h{index % 2}"} for index, name in enumerate(names)
        },
        "order": names,
        "connections": [f"{one}.out -> {two}.a" for one, two in pairwise(names)],
    }
    (directory / "session.yaml").write_text(json.dumps(scenario))
    return subprocess.run(
        ["sh", "-c", RUN.format(limit=limit), sys.executable],
        cwd=directory,
        capture_output=True,
        text=True,
        timeout=150,
        check=False,
    )


def test_a_session_that_needs_more_than_the_system_allows_says_so_at_its_start(toys, tmp_path):
    ran = limited(tmp_path, "-n 64")
    assert (ran.returncode, ran.stdout) == (1, "")
    assert "each process may have 64 files and sockets open" in ran.stderr
    assert "ulimit -n 1024" in ran.stderr
    assert "Traceback" not in ran.stderr
    assert not (tmp_path / "bag").exists()


def test_a_limit_of_the_user_is_raised_as_far_as_the_session_needs(toys, tmp_path):
    ran = limited(tmp_path, "-Sn 64")
    assert (ran.returncode, json.loads(ran.stdout)["state"]) == (0, "done"), ran.stderr
