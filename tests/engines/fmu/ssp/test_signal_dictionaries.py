"""Signals that pass a dictionary, which several systems refer to."""

from __future__ import annotations

from pathlib import Path

import pytest

from engines.fmu.ssp.system_import import import_system
from hub.planning.scenario_file import load
from hub.session.launch import launch
from schemas.errors import ScenarioError
from tests.engines.fmu.driving import SPRING
from tests.engines.fmu.ssp.systems import (
    MEANT,
    SPRING_OF,
    F,
    System,
    X,
    component,
    connection,
    connections,
    connector,
    elements,
    value,
    values,
    write_fmus,
    write_system,
)
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

UNLIKE = 'suppressUnitConversion="true"'


def reference(name: str) -> str:
    inside = connector("place", "inout", unit="mm")
    return (
        f'<ssd:SignalDictionaryReference name="{name}" dictionary="bus"><ssd:Connectors>{inside}'
        "</ssd:Connectors></ssd:SignalDictionaryReference>"
    )


def system(*more: str) -> System:
    """One spring writes its place to the bus in mm; one beside it and one in a system inside read it."""
    text = (
        elements(
            component("one", SPRING, X, values(value("x", "Real", "0.2"))),
            reference("outside"),
            component("two", SPRING, F + X),
            '<ssd:System name="inner">',
            elements(reference("inside"), component("three", SPRING, F)),
            connections(connection("inside.place", "three.F", attributes=UNLIKE)),
            "</ssd:System>",
        )
        + connections(
            connection("outside.place", "one.x"),
            connection("outside.place", "two.F", '<ssc:LinearTransformation factor="0.5"/>', UNLIKE),
            *more,
        )
        + '<ssd:SignalDictionaries><ssd:SignalDictionary name="bus"/></ssd:SignalDictionaries>'
    )
    return System(
        text,
        f"""\
participants:
  one: {{{SPRING_OF}, start: {{x: 0.2}}}}
  two: {{{SPRING_OF}, inputs: {{F: {{unit: m, factor: 500}}}}}}
  inner_three: {{{SPRING_OF}, inputs: {{F: {{unit: m, factor: 1000}}}}}}
connections: [one.x -> two.F, one.x -> inner_three.F]
""",
    )


def test_signals_become_connections(libraries: dict[str, Path], tmp_path: Path) -> None:
    write_fmus(libraries, tmp_path)
    (tmp_path / "meant.yaml").write_text(MEANT.format(name="bus") + system().meant)
    imported = import_system(write_system(system(), "bus", tmp_path), tmp_path / "out")
    assert imported.lost == []
    hashes = [launch(load(str(file))).run().state_hash for file in (tmp_path / "meant.yaml", imported.file)]
    assert hashes[0] == hashes[1]


def test_a_signal_with_two_writers_is_refused(libraries: dict[str, Path], tmp_path: Path) -> None:
    write_fmus(libraries, tmp_path)
    path = write_system(system(connection("two.x", "outside.place")), "bus", tmp_path)
    with pytest.raises(
        ScenarioError, match=r"'dictionary bus.place' is fed twice, by 'one.x' and by 'two.x'"
    ):
        import_system(path, tmp_path / "out")
