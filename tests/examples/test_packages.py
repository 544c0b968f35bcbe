"""The packages in examples/: installed, checked by their own tests, and run, as a user does."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
PACKAGES = sorted(file.parent for file in EXAMPLES.glob("*/pyproject.toml"))
SCENARIOS = sorted(EXAMPLES.glob("*/*.yaml"))
CLEAN = {key: value for key, value in os.environ.items() if key not in {"PYTHONPATH", "VIRTUAL_ENV"}}


def succeed(*command: str | Path, cwd: Path) -> str:
    words = [str(word) for word in command]
    done = subprocess.run(words, cwd=cwd, env=CLEAN, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The interpreter of a new environment: the packages of this one, and the examples installed into it."""
    directory = tmp_path_factory.mktemp("environment") / "venv"
    succeed(sys.executable, "-m", "venv", "--without-pip", directory, cwd=directory.parent)
    python = directory / "bin" / "python"
    packages = succeed(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=directory)
    here = [place for place in sys.path if "site-packages" in place]
    root = str(EXAMPLES.parent)
    (Path(packages.strip()) / "this_environment.pth").write_text("\n".join([*here, root]) + "\n")
    copies = shutil.copytree(EXAMPLES, directory.parent / "examples")
    command = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps"]
    sources = [word for package in PACKAGES for word in ("--editable", copies / package.name)]
    succeed(*command, "--no-build-isolation", *sources, cwd=directory.parent)
    return python


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
