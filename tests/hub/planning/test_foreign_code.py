"""A scenario that names code says so before any of it is imported."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from hub.planning.scenario_file import load

MODULE = """
import logging

logging.getLogger("foreign").warning("imported")


"""

SCENARIO = """\
name: guest
step: 1 ms
participants:
  plant: {kind: fmu, path: missing.fmu}
  stylus: {kind: touch, styluses: {right: {}}}
  pendulum: {kind: pendulum, length: 1}
scene: {library: ./vendor.so}
"""


@pytest.fixture
def scenario(pendulum: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    (tmp_path / "foreign_module.py").write_text(MODULE)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "session.yaml").write_text(SCENARIO)
    yield str(tmp_path / "session.yaml")
    sys.modules.pop("foreign_module", None)


def test_one_line_names_the_code_before_it_is_imported(
    scenario: str, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO):
        load(scenario, ["participants.other.kind=swing:Pendulum", "participants.other.length=1"])
    assert caplog.messages == [
        "this scenario runs code that is not installed as a kind: ./vendor.so, missing.fmu, swing:Pendulum"
    ]


def test_before_an_import_that_fails(scenario: str, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO), pytest.raises(Exception, match="participants"):
        load(scenario, ["participants.other.kind=foreign_module:Nothing"])
    assert caplog.messages[-1] == "imported"
    assert "foreign_module:Nothing" in caplog.messages[-2]


def test_installed_scenarios_and_kinds_have_none(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        load("table")
    assert caplog.messages == []
