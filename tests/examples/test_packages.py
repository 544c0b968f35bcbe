"""The packages in examples/: installed, checked by their own tests, and run, as a user does."""

import json
import os
import shutil
import tomllib
from pathlib import Path

import pytest

from tests.wheel.environments import install, succeed, with_our_packages

pytestmark = [
    pytest.mark.release,
    pytest.mark.xdist_group("examples"),  # its fixtures are expensive: made once, in one process
]

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
PACKAGES = sorted(file.parent for file in EXAMPLES.glob("*/pyproject.toml"))
SCENARIOS = sorted(EXAMPLES.glob("*/*.yaml"))


@pytest.fixture(scope="module")
def python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The interpreter of a new environment with Trocar as it stands here and the examples."""
    place = tmp_path_factory.mktemp("environment")
    there = with_our_packages(place / "venv")
    (root,) = (place / "venv").glob("lib/*/site-packages")
    (root / "trocar.pth").write_text(f"{EXAMPLES.parent}\n")
    copies = shutil.copytree(EXAMPLES, place / "examples")
    sources = [word for package in PACKAGES for word in ("--editable", copies / package.name)]
    install(there, "--no-deps", "--no-build-isolation", *sources)
    return there / "python"


def test_each_example_is_small_and_has_a_line() -> None:
    readme = (EXAMPLES / "README.md").read_text()
    for path in [*PACKAGES, *EXAMPLES.glob("*.py")]:
        assert f"[{path.name}]({path.name})" in readme
    for package in PACKAGES:
        lines = [len(file.read_text().splitlines()) for file in package.glob("*.py")]
        assert max(lines) < (60 if package.name != "two_mass" else 120)


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_it_is_found_and_its_own_test_passes(python: Path, package: Path) -> None:
    entry_points = tomllib.loads((package / "pyproject.toml").read_text())["project"]["entry-points"]
    mine = {kind for group in entry_points.values() for kind in group}
    script = "from hub.planning.registry import kinds; print(*kinds())"
    assert mine <= {*succeed(python, "-P", "-c", script, cwd=package).split()}
    succeed(python, "-P", "-m", "pytest", "-q", "-c", os.devnull, "--rootdir", package, package, cwd=package)


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda scenario: scenario.stem)
def test_its_scenario_is_checked_and_run(python: Path, scenario: Path, tmp_path: Path) -> None:
    trocar = [python, "-P", "-m", "trocar"]
    succeed(*trocar, "check", scenario, cwd=tmp_path)
    short = ["--set", "duration=100 ms", "--json"]
    summary = json.loads(succeed(*trocar, "run", scenario, *short, cwd=tmp_path))
    assert (summary["state"], summary["steps"]) == ("done", 100)
