import os
from pathlib import Path

import pytest

SCENARIO = """\
name: swept
step: 1 ms
duration: 3 ms
participants:
  part: {kind: "sweep_parts:Killed"}
measure:
  value: {kind: final, of: part.value}
"""


@pytest.fixture
def scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a scenario of three steps whose participant can kill its own process."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent), prepend=os.pathsep)
    monkeypatch.syspath_prepend(Path(__file__).parent)
    file = tmp_path / "swept.yaml"
    file.write_text(SCENARIO)
    return file
