"""Mutated scenarios through `trocar check`: each is valid, or rejected with exit code 2 and a sentence.

`python -m tests.fuzz.scenarios --hours 1 --seed 7` searches for longer than CI does; with `--case 7:123` it
repeats one scenario.
"""

from __future__ import annotations

import os
import random
import sys
import traceback
from pathlib import Path

from hub.command_line.app import main as trocar
from hub.planning.scenario_file import installed_scenarios, load
from hub.session.launch import plan_of
from schemas.errors import ScenarioError
from tests.fuzz.harness import Note, Target, search
from tests.fuzz.scenario_mutations import mutated


def prepare(_directory: Path) -> None:
    """Plan every installed scenario."""
    for name in installed_scenarios():
        file = load(name)
        plan_of(file.scenario, file.params)


def pristine(directory: Path) -> None:
    """Check a scenario as a command does."""
    _check(installed_scenarios()["palpation"], [], directory)


def attempt(case: str, directory: Path, note: Note) -> None:
    """Check the scenario of `case`, SEED:NUMBER."""
    random_source = random.Random(case)
    name, file = random_source.choice(sorted(installed_scenarios().items()))
    label, data, overrides = mutated(file.read_text(encoding="utf-8"), random_source)
    note(f"{name}: {label}")
    path = directory / "mutated.yaml"
    path.write_bytes(data)
    _check(path, overrides, directory)


def _check(path: Path, overrides: list[str], directory: Path) -> None:
    """Run `trocar check` as a command does; raise ScenarioError if it rejects the scenario."""
    said = directory / "errors.txt"
    before, file = os.dup(2), os.open(said, os.O_RDWR | os.O_CREAT | os.O_TRUNC)
    os.dup2(file, 2)
    sys.argv = ["trocar", "check", str(path), *(part for text in overrides for part in ("--set", text))]
    code = 1
    try:
        trocar()
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except Exception:  # noqa: BLE001 - reported below
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os.dup2(before, 2)
        os.close(file)
        os.close(before)
    text = said.read_text(encoding="utf-8", errors="replace")
    rejected = any(line.startswith("error: ") for line in text.splitlines())  # behind what is logged
    if code not in (0, 2) or "Traceback" in text or rejected != (code == 2):
        raise AssertionError(f"exit code {code}: {text[-3000:]}")
    if code == 2:
        raise ScenarioError(text)


if __name__ == "__main__":
    sys.exit(search(Target(attempt, pristine, prepare), __doc__ or "", hours=15 / 3600))
