"""Ten systems: imported, run, exported, imported again and run again, with the same bits."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from hub.command_line.app import app
from hub.planning.scenario_file import load
from hub.session.launch import launch
from tests.engines.fmu.ssp.systems import MEANT, SYSTEMS, write_fmus, write_system
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)


def run(scenario: Path) -> str:
    summary = launch(load(str(scenario))).run()
    assert summary.state == "done"
    return summary.state_hash


def command(*words: str | Path) -> str:
    result = CliRunner().invoke(app, [str(word) for word in words])
    assert result.exit_code == 0, f"{result.output}\n{result.exception}"
    return result.stdout


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_system_goes_round(name: str, libraries: dict[str, Path], tmp_path: Path) -> None:
    write_fmus(libraries, tmp_path)
    system = SYSTEMS[name]
    meant = tmp_path / "meant.yaml"
    meant.write_text(MEANT.format(name=name) + system.meant)
    expected = run(meant)

    command("import", write_system(system, name, tmp_path), "-o", tmp_path / "first")
    first = tmp_path / "first" / f"{name}.yaml"
    command("check", first)
    assert run(first) == expected

    command("export", first, "-o", tmp_path / "again.ssp")
    text = command("import", tmp_path / "again.ssp", "-o", tmp_path / "second")
    assert "not carried over" not in text
    assert run(tmp_path / "second" / f"{name}.yaml") == expected
