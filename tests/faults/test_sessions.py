import subprocess
import sys
from pathlib import Path

import pytest

CASES = {
    "1:11": "kill hub, birth",
    "1:34": "kill host one, run",
    "1:44": "kill hub, run + 4 ms, with its host stopped",
    "1:50": "kill host hand, close",
}


@pytest.mark.search
@pytest.mark.skipif(sys.platform != "linux", reason="it looks for what is left in /proc")
def test_a_session_of_which_a_part_is_killed_ends_as_it_should():
    done = subprocess.run(
        [sys.executable, "-m", "tests.faults.sessions", "--case", *CASES],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    for case, fault in CASES.items():
        assert f"{case} {fault}" in " ".join(done.stdout.split())
