import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.skipif(sys.platform != "linux", reason="each scenario runs in a forked process")
def test_a_mutated_scenario_is_valid_or_rejected_with_a_sentence():
    done = subprocess.run(
        [sys.executable, "-m", "tests.fuzz.scenarios", "--seed", "1", "--hours", str(15 / 3600)],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
