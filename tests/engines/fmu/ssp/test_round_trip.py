"""Ten systems: imported, run, exported, imported again and run again, with the same bits."""

from __future__ import annotations

import zipfile
from importlib.util import find_spec
from pathlib import Path

import fmpy
import pytest
from fmpy.ssp.simulation import simulate_ssp
from lxml import etree
from typer.testing import CliRunner

from engines.fmu.ssp.system_import import import_system
from hub.command_line.app import app
from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from hub.verify import verify
from schemas.errors import ScenarioError
from tests.engines.fmu.driving import SPRING, STAIR
from tests.engines.fmu.ssp.systems import (
    MEANT,
    SYSTEMS,
    F,
    System,
    X,
    component,
    connection,
    connections,
    connector,
    elements,
    write_fmus,
    write_system,
)
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


def test_a_scenario_with_other_participants_is_not_exported(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["export", "table", "-o", str(tmp_path / "table.ssp")])
    assert result.exit_code != 0
    assert "these participants are none: " in str(result.exception)
    assert "robot (mujoco)" in str(result.exception)
    assert not (tmp_path / "table.ssp").exists()


def test_settings_measures_and_texts_survive(libraries: dict[str, Path], tmp_path: Path) -> None:
    write_fmus(libraries, tmp_path)
    (tmp_path / "full.yaml").write_text(FULL)
    command("export", tmp_path / "full.yaml", "-o", tmp_path / "full.ssp")
    command("import", tmp_path / "full.ssp", "-o", tmp_path / "back")
    before, after = (launch(load(str(tmp_path / file))).run() for file in ("full.yaml", "back/full.yaml"))
    assert (after.state_hash, after.measures) == (before.state_hash, before.measures)
    scenario = load(str(tmp_path / "back" / "full.yaml"))
    assert (scenario.scenario.step, scenario.scenario.order) == (5_000_000, ["two", "one"])
    assert scenario.scenario.participants["one"].period == 10_000_000
    assert scenario.params["one"].model_dump()["tolerance"] == 1e-5


def test_texts_survive(libraries: dict[str, Path], tmp_path: Path) -> None:
    write_fmus(libraries, tmp_path)
    (tmp_path / "texts.yaml").write_text(
        "name: texts\nstep: 1 ms\nparticipants:\n  one: {kind: fmu, path: resources/mass_spring_damper.fmu,"
        ' start: {label: "a <b> & \\"c\\"\\n  d"}}\n'
    )
    command("export", tmp_path / "texts.yaml", "-o", tmp_path / "texts.ssp")
    command("import", tmp_path / "texts.ssp", "-o", tmp_path / "back")
    start = load(str(tmp_path / "back" / "texts.yaml")).params["one"].model_dump()["start"]
    assert start == {"label": 'a <b> & "c"\n  d'}


def test_a_recording_with_conversions_verifies(libraries: dict[str, Path], tmp_path: Path) -> None:
    write_fmus(libraries, tmp_path)
    (tmp_path / "full.yaml").write_text(FULL)
    launch(load(str(tmp_path / "full.yaml")), record=tmp_path / "recording").run()
    again = verify(Recording(tmp_path / "recording"), trust=True)
    assert (again.same, again.steps) == (True, 40)


FULL = """\
name: full
step: 5 ms
duration: 200 ms
order: [two, one]
participants:
  one:
    kind: fmu
    path: resources/mass_spring_damper.fmu
    period: 10 ms
    step: 5 ms
    tolerance: 1e-5
    start: {m: 250 g, x: 0.1, stage: 2, locked: true, fault: 0}
  two:
    kind: fmu
    path: resources/mass_spring_damper.fmu
    inputs: {F: {unit: m, factor: -3.3, offset: 0.1}, stage: {table: {1: 2}}}
  three: {kind: fmu, path: resources/mass_spring_damper.fmu, inputs: {stage: {table: {0: 1}}}}
  stair: {kind: fmu, path: resources/stair.fmu}
connections:
  - one.x -> two.F
  - stair.counter -> two.stage
  - stair.counter -> three.stage
measure:
  swing: {kind: swing, of: two.x}
"""


@pytest.mark.parametrize("name", SYSTEMS)
def test_an_export_obeys_the_schema(name: str, libraries: dict[str, Path], tmp_path: Path) -> None:
    """The schemas of SSP 1.0 come with FMPy, those of 2.0 with pyssp-standard."""
    write_fmus(libraries, tmp_path)
    (tmp_path / "meant.yaml").write_text(MEANT.format(name=name) + SYSTEMS[name].meant)
    command("export", tmp_path / "meant.yaml", "-o", tmp_path / "out.ssp")
    with zipfile.ZipFile(tmp_path / "out.ssp") as archive:
        tree = etree.fromstring(archive.read("SystemStructure.ssd"))
    if tree.get("version") == "1.0":
        folder = Path(fmpy.__file__).parent / "ssp" / "schema"
    else:
        found = find_spec("pyssp_standard")
        if found is None or found.origin is None:
            pytest.skip("the schemas of SSP 2.0 are not shipped; pyssp-standard has them")
        folder = Path(found.origin).parent / "resources" / "ssp2"
    for file, root in (("Description", tree), *_inner(tree)):
        schema = etree.XMLSchema(etree.parse(str(folder / f"SystemStructure{file}.xsd")))
        schema.assertValid(root)


def _inner(tree: etree._Element) -> list[tuple[str, etree._Element]]:
    """Return the inline parameter sets, each as a root of its own, with their schema."""
    uri = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
    return [
        ("ParameterValues", etree.fromstring(etree.tostring(one)))
        for one in tree.iter(f"{{{uri}}}ParameterSet")
    ]


def test_fmpy_gives_the_same_trajectory(libraries: dict[str, Path], tmp_path: Path) -> None:
    """FMPy's `simulate_ssp` knows FMI 2.0 and plain connections; its inputs are 0 in the first step."""
    write_fmus(libraries, tmp_path)
    library = build.compile_library(STAIR, tmp_path, "-DALL_FUNCTIONS")
    build.pack(STAIR, library, tmp_path / "resources" / f"{STAIR}.fmu")
    text = elements(
        component("stair", STAIR, connector("ticks", "output", "Integer")), component("spring", SPRING, F + X)
    ) + connections(connection("stair.ticks", "spring.F"))
    path = write_system(System(text, "", fmus=(STAIR, SPRING)), "plain", tmp_path)
    rows = simulate_ssp(str(path), stop_time=3.75, step_size=0.125)  # sums of it are exact
    imported = import_system(path, tmp_path / "out")
    build.pack(STAIR, libraries[STAIR], tmp_path / "out" / "resources" / f"{STAIR}.fmu")
    scenario = tmp_path / "out" / "measured.yaml"
    scenario.write_text(imported.file.read_text() + "measure: {x: {kind: final, of: spring.x}}\n")
    for steps in (1, 2, 17, 30):
        overrides = ["step=125 ms", f"duration={125 * steps} ms"]
        found = launch(load(str(scenario), overrides)).run().measures["x"]
        assert found == rows["spring.x"][steps - 1]
        assert found or steps == 1


@pytest.mark.parametrize("name", SYSTEMS)
def test_pyssp_standard_reads_an_export(name: str, libraries: dict[str, Path], tmp_path: Path) -> None:
    reader = pytest.importorskip("pyssp_standard.ssp", reason="pyssp-standard is not installed")
    write_fmus(libraries, tmp_path)
    (tmp_path / "meant.yaml").write_text(MEANT.format(name=name) + SYSTEMS[name].meant)
    command("export", tmp_path / "meant.yaml", "-o", tmp_path / "out.ssp")
    scenario = load(str(tmp_path / "meant.yaml")).scenario
    with reader.SSP(tmp_path / "out.ssp", mode="r") as package, package.system_structure as structure:
        assert {one.name for one in structure.system.elements} == set(scenario.participants)
        assert len(structure.connections()) == len(scenario.connections)
        assert structure.check_connections() == []


def test_model_exchange_is_kept(libraries: dict[str, Path], tmp_path: Path) -> None:
    write_fmus(libraries, tmp_path)
    folder = tmp_path / "resources"
    library = build.compile_library("hopper", tmp_path)
    build.pack("hopper", library, folder / "hopper.fmu")
    text = elements(component("one", "hopper")).replace(
        "<ssd:Component", '<ssd:Component implementation="ModelExchange"'
    )
    path = write_system(System(text, "", fmus=("hopper",)), "hopping", tmp_path)
    imported = import_system(path, tmp_path / "out")
    command("export", imported.file, "-o", tmp_path / "again.ssp")
    with zipfile.ZipFile(tmp_path / "again.ssp") as archive:
        assert b'implementation="ModelExchange"' in archive.read("SystemStructure.ssd")
    again = import_system(tmp_path / "again.ssp", tmp_path / "back")
    assert run(again.file) == run(imported.file)


def test_an_implementation_that_the_fmu_lacks(libraries: dict[str, Path], tmp_path: Path) -> None:
    write_fmus(libraries, tmp_path)
    text = elements(component("one", STAIR)).replace(
        "<ssd:Component", '<ssd:Component implementation="ModelExchange"'
    )
    path = write_system(System(text, "", fmus=(STAIR,)), "stair", tmp_path)
    with pytest.raises(
        ScenarioError, match=r"implementation 'ModelExchange' of the FMU.*; it has CoSimulation"
    ):
        import_system(path, tmp_path / "out")
