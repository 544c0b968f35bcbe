"""Virtual environments that tests install into, and commands in them."""

import os
import subprocess
import sys
from pathlib import Path

__all__ = ["CLEAN", "bare", "install", "run", "succeed", "with_our_packages"]

CLEAN = {
    key: value
    for key, value in os.environ.items()
    if key not in {"PYTHONPATH", "PYTHONSAFEPATH", "VIRTUAL_ENV"}
}


def run(*command: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    words = [str(part) for part in command]
    return subprocess.run(words, cwd=cwd, env=CLEAN, capture_output=True, text=True, timeout=600, check=False)


def succeed(*command: str | Path, cwd: Path) -> str:
    done = run(*command, cwd=cwd)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def bare(directory: Path) -> Path:
    """Return the `bin` of a new environment with nothing in it."""
    succeed(sys.executable, "-m", "venv", "--without-pip", directory, cwd=directory.parent)
    return directory / "bin"


def with_our_packages(directory: Path) -> Path:
    """Return the `bin` of a new environment that sees the packages of this one, installs into it go first.

    A path in a .pth file is searched, but .pth files there are not read: the editable Trocar stays outside.
    """
    there = bare(directory)
    script = "import sysconfig; print(sysconfig.get_path('purelib'))"
    packages = Path(succeed(there / "python", "-c", script, cwd=directory).strip())
    ours = [place for place in sys.path if Path(place).name == "site-packages"]
    (packages / "ours.pth").write_text("\n".join(ours) + "\n")
    return there


def install(there: Path, *words: str | Path) -> None:
    """Install with this environment's pip into the one whose `bin` is `there`."""
    pip = [sys.executable, "-m", "pip", "--python", there / "python", "install", "--quiet", "--no-compile"]
    succeed(*pip, *words, cwd=there)
