"""Libraries that are not where they should be, lack functions or need what this machine does not have."""

from __future__ import annotations

import logging
import subprocess
import zipfile
from pathlib import Path

import pytest

from engines.fmu.engine import FmuEngine, FmuParams
from hub.participant import Setup
from schemas.errors import ScenarioError, StateError
from tests.engines.fmu.driving import BALL, MS, SPRING, STAIR, Make, run
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)


def error_of(path: Path, tmp_path: Path) -> str:
    with (
        FmuEngine("plant", FmuParams(path=path)) as engine,
        pytest.raises(ScenarioError) as caught,
    ):
        engine.configure(Setup(period_ns=MS, directory=tmp_path))
    return str(caught.value)


@pytest.mark.parametrize(
    ("model", "folder"), [(SPRING, "linux64"), (BALL, "x86_64-linux")], ids=["FMI 2", "FMI 3"]
)
def test_the_folder_is_there_and_the_file_is_not(
    libraries: dict[str, Path], tmp_path: Path, model: str, folder: str
) -> None:
    path = tmp_path / "other.fmu"
    with zipfile.ZipFile(path, "w") as opened:
        opened.write(build.HERE / model / "modelDescription.xml", "modelDescription.xml")
        opened.write(libraries[model], f"binaries/{folder}/other.so")
        opened.write(libraries[model], f"binaries/win64/{model}.dll")
    error = error_of(path, tmp_path)
    assert f"has no file 'binaries/{folder}/{model}.so'" in error
    assert "That folder holds: other.so." in error
    assert "no binary for this platform" not in error


def test_the_folder_is_empty(libraries: dict[str, Path], tmp_path: Path) -> None:
    path = build.pack(SPRING, libraries[SPRING], tmp_path / "empty.fmu", folder="win64")
    with zipfile.ZipFile(path, "a") as opened:
        opened.mkdir("binaries/linux64")
    assert "has no file 'binaries/linux64/mass_spring_damper.so'" in error_of(path, tmp_path)


@pytest.mark.parametrize(
    ("soname", "package"),
    [
        ("libgfortran.so.3", "libgfortran3"),
        ("libopenmodelica2.so.1", "libopenmodelica2-1"),
        ("libmine.so", "libmine"),
    ],
)
def test_a_system_library_that_is_missing(tmp_path: Path, soname: str, package: str) -> None:
    source = tmp_path / "elsewhere.c"
    source.write_text("int needed_of_elsewhere(void) { return 1; }\n")
    elsewhere = tmp_path / soname
    compiler = build.COMPILER
    assert compiler
    subprocess.run(
        [compiler, "-shared", "-fPIC", f"-Wl,-soname,{soname}", str(source), "-o", str(elsewhere)], check=True
    )
    library = build.compile_library(STAIR, tmp_path, "-DNEEDS_LIBRARY", str(elsewhere))
    elsewhere.unlink()
    error = error_of(build.pack(STAIR, library, tmp_path / "needs.fmu"), tmp_path)
    assert f"it needs the system library '{soname}', which is not installed" in error
    assert f"on Debian and Ubuntu '{package}'" in error


class TestMissingFunctions:
    def test_optional_ones(self, make: Make, caplog: pytest.LogCaptureFixture) -> None:
        """The stair has no function for its state, inputs' slopes or types that it does not use."""
        engine = make(STAIR, period=100 * MS)
        assert run(engine, 25, period=100 * MS)["counter"] == 3
        assert any("its library lacks fmi2GetFMUstate" in line for line in caplog.messages)
        for attempt in (engine.save, lambda: engine.restore(b"")):
            with pytest.raises(StateError, match="its library lacks functions for it"):
                attempt()

    def test_hashes_without_a_state(self, make: Make) -> None:
        one, other = make(STAIR, period=100 * MS), make(STAIR, period=100 * MS)
        before = one.state_hash()
        run(one, 15, period=100 * MS)
        run(other, 15, period=100 * MS)
        assert one.state_hash() == other.state_hash() != before

    def test_one_that_is_needed(self, tmp_path: Path) -> None:
        library = build.compile_library(STAIR, tmp_path, "-DNO_STEP")
        error = error_of(build.pack(STAIR, library, tmp_path / "no_step.fmu"), tmp_path)
        assert "cannot be used: it lacks fmi2DoStep" in error

    def test_one_for_an_output(self, libraries: dict[str, Path], tmp_path: Path) -> None:
        edits = {'initial="exact"><Integer start="0"/>': 'initial="exact"><Real start="0"/>'}
        path = build.pack(STAIR, libraries[STAIR], tmp_path / "real.fmu", edits)
        assert "it lacks fmi2GetReal" in error_of(path, tmp_path)


class TestEventMode:
    """Of FMI 3: an instance uses it only if the FMU has one."""

    @pytest.mark.parametrize("declared", [' hasEventMode="true"', ' hasEventMode="false"', ""])
    def test_an_fmu_that_has_none(
        self, tmp_path: Path, caplog: pytest.LogCaptureFixture, declared: str
    ) -> None:
        library = build.compile_library(BALL, tmp_path, "-DNO_EVENT_MODE")
        path = build.pack(BALL, library, tmp_path / "ball.fmu", {' hasEventMode="true"': declared})
        with FmuEngine("plant", FmuParams(path=path)) as engine, caplog.at_level(logging.WARNING):
            engine.configure(Setup(period_ns=MS, directory=tmp_path))
            assert run(engine, 2000)["bounces"] == 4
        claims = "true" in declared
        assert any("no event mode here" in line for line in caplog.messages) == claims
