"""A short search with each harness; by hand they search for longer."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [
    pytest.mark.search,
    pytest.mark.skipif(sys.platform != "linux", reason="the inputs are tried in forked processes"),
]


@pytest.mark.parametrize(
    ("harness", "limit"),
    [
        ("scenarios", ("--number", "40")),
        ("wire", ("--number", "1500")),
        ("recordings", ("--number", "16")),
        ("meshes", ("--number", "400")),
        ("fmus", ("--number", "150")),
        ("systems", ("--number", "150")),
        ("ros", ("--number", "40")),
        ("page", ("--number", "300")),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_mutated_input_is_valid_or_rejected_with_a_sentence(harness: str, limit: tuple[str, str]) -> None:
    done = subprocess.run(
        [sys.executable, "-m", f"tests.fuzz.{harness}", "--seed", "1", *limit],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
