"""Components that are a system in a file of its own: an SSD file or an archive of its own."""

from __future__ import annotations

import zipfile
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
    description,
    elements,
    value,
    values,
    write_fmus,
)
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

INNER = System(
    f"<ssd:Connectors>{F + X}</ssd:Connectors><ssd:ParameterBindings>"
    + values(value("spring.c", "Real", "30") + value("spring.d", "Real", "0.2"))
    + "</ssd:ParameterBindings>"
    + elements(component("spring", "{fmu}", F + X))
    + connections(connection(".F", "spring.F"), connection("spring.x", ".x")),
    "",
)
OUTER = System(
    elements(
        '<ssd:Component name="one" type="application/x-ssp-definition" source="resources/inner.ssd"/>',
        '<ssd:Component name="two" type="application/x-ssp-package" source="resources/inner.ssp">'
        "<ssd:ParameterBindings>",
        values(value("spring.c", "Real", "40")),
        "</ssd:ParameterBindings></ssd:Component>",
        component("drive", SPRING, X, values(value("x", "Real", "0.3"))),
    )
    + connections(
        connection("drive.x", "one.F", attributes='suppressUnitConversion="true"'),
        connection("one.x", "two.F", attributes='suppressUnitConversion="true"'),
    ),
    f"""\
participants:
  one_spring: {{{SPRING_OF}, start: {{c: 30, d: 0.2}}, inputs: {{F: {{unit: m}}}}}}
  two_spring: {{{SPRING_OF}, start: {{c: 40, d: 0.2}}, inputs: {{F: {{unit: m}}}}}}
  drive: {{{SPRING_OF}, start: {{x: 0.3}}}}
connections: [drive.x -> one_spring.F, one_spring.x -> two_spring.F]
""",
)


def write(directory: Path, inner: str) -> Path:
    """Write the outer system: its own FMU, a description beside it, and an archive with another copy."""
    fmu = directory / "resources" / f"{SPRING}.fmu"
    with zipfile.ZipFile(directory / "inner.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", inner.replace("{fmu}", SPRING))
        archive.write(fmu, f"resources/{SPRING}.fmu")
    with zipfile.ZipFile(directory / "outer.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", description(OUTER, "outer"))
        # the folder of a URI is that of the file with the URI
        archive.writestr("resources/inner.ssd", inner.replace("resources/{fmu}", SPRING))
        archive.write(directory / "inner.ssp", "resources/inner.ssp")
        archive.write(fmu, f"resources/{SPRING}.fmu")
    return directory / "outer.ssp"


def test_they_run_as_written_by_hand(libraries: dict[str, Path], tmp_path: Path) -> None:
    write_fmus(libraries, tmp_path)
    (tmp_path / "meant.yaml").write_text(MEANT.format(name="outer") + OUTER.meant)
    imported = import_system(write(tmp_path, description(INNER, "inner")), tmp_path / "out")
    hashes = [launch(load(str(file))).run().state_hash for file in (tmp_path / "meant.yaml", imported.file)]
    assert hashes[0] == hashes[1]
    assert len(list((tmp_path / "out" / "resources").iterdir())) == 2


@pytest.mark.parametrize(
    ("inner", "expected"),
    [
        ("<a/>", "resources/inner.ssd, line 1: the root element is ?:a"),
        (
            description(System(elements('<ssd:Component name="again" type="application/x-ssp-definition"'
                                        ' source="inner.ssd"/>'), ""), "inner"),
            "more than 20 systems inside each other",
        ),
        (
            description(System(elements('<ssd:Component name="again" type="application/x-ssp-package"'
                                        ' source="inner.ssp#Other.ssd"/>'), ""), "inner"),
            "'resources/inner.ssp' has no file 'Other.ssd'",
        ),
    ],
)  # fmt: skip
def test_broken_ones_are_refused(
    inner: str, expected: str, libraries: dict[str, Path], tmp_path: Path
) -> None:
    write_fmus(libraries, tmp_path)
    with pytest.raises(ScenarioError) as caught:
        import_system(write(tmp_path, inner), tmp_path / "out")
    assert expected in str(caught.value)
    assert not (tmp_path / "out").exists()
