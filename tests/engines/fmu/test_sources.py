"""FMUs of C sources: compiled where there is no library, and refused with the compiler's reason."""

from __future__ import annotations

import re
import shutil
import zipfile
from pathlib import Path

import pytest

import configs
from engines.fmu import sources
from engines.fmu.engine import FmuEngine, FmuParams
from hub.participant import Setup
from schemas.errors import ScenarioError
from tests.engines.fmu.driving import MS, run
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

DRIVE = Path(configs.__file__).parent / "data" / "tendon_drive"


def started(path: Path) -> FmuEngine:
    engine = FmuEngine("drive", FmuParams(path=path))
    engine.configure(Setup(period_ns=MS, directory=path.parent))
    return engine


def test_a_directory_and_its_archive_are_the_same(tmp_path: Path) -> None:
    shutil.make_archive(str(tmp_path / "drive"), "zip", DRIVE)
    (tmp_path / "drive.zip").rename(tmp_path / "drive.fmu")
    hashes: list[int] = []
    for path in (DRIVE, tmp_path / "drive.fmu"):
        engine = started(path)
        run(engine, 3)
        hashes.append(engine.state_hash())
        engine.close()
    assert hashes[0] == hashes[1]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("no C at all", r": (sources/)?tendon_drive\.c:1:\d+: error: "),
        ("int a = b;\nint c = d;", r":1:\d+: error: .* \(1 further errors\)$"),
        ('#include "absent.h"', r"absent\.h"),
    ],
)
def test_the_first_error_of_the_compiler_is_shown(tmp_path: Path, text: str, expected: str) -> None:
    with zipfile.ZipFile(tmp_path / "drive.fmu", "w") as archive:
        archive.write(DRIVE / "modelDescription.xml", "modelDescription.xml")
        archive.writestr("sources/tendon_drive.c", text)
    with pytest.raises(ScenarioError, match=r"the sources of .* cannot be compiled by ") as caught:
        started(tmp_path / "drive.fmu")
    assert re.search(expected, str(caught.value))
    assert "\n" not in str(caught.value)


def test_without_a_compiler_it_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(sources.shutil, "which", lambda _: None)
    with pytest.raises(ScenarioError, match=r"is an FMU of C sources .* no C compiler"):
        _ = FmuEngine("drive", FmuParams(path=DRIVE)).ports
    (tmp_path / "sources").mkdir()
    with pytest.raises(ScenarioError, match="this machine has no C compiler; install cc, gcc or clang"):
        sources.provide_library(DRIVE, tmp_path, "binaries/here/drive.so", ("other.c",))
