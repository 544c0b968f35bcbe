"""The archive is data from a stranger: what could do harm is refused, and nothing is written."""

from __future__ import annotations

import stat
import struct
import zipfile
from pathlib import Path

import pytest

from engines.fmu import archive
from engines.fmu.engine import FmuEngine, FmuParams
from hub.participant import Setup
from schemas.errors import ScenarioError
from tests.engines.fmu.driving import BALL, MS, SPRING
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

LAUGHS = (
    '<!DOCTYPE a [<!ENTITY b "ha"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">'
    '<!ENTITY d "&c;&c;&c;&c;&c;&c;&c;&c;&c;&c;">]>'
)
FILE_OF_THIS_MACHINE = '<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/hostname">]>'


@pytest.fixture
def fmu(libraries: dict[str, Path], tmp_path: Path) -> Path:
    """An FMU that runs, alone in a directory."""
    (tmp_path / "inner").mkdir()
    return build.pack(SPRING, libraries[SPRING], tmp_path / "inner" / "plant.fmu")


def refusal(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Return why `path` is refused: when its ports are read, when it is unpacked, with nothing written."""
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(scratch))
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(ScenarioError) as caught:
        FmuEngine("plant", FmuParams(path=path)).configure(Setup(period_ns=MS, directory=tmp_path))
    assert caught.value.path == ("participants", "plant", "path")
    with pytest.raises(ScenarioError, match="is refused"):
        archive.unpack(path, scratch)
    assert sorted(tmp_path.rglob("*")) == before
    return str(caught.value)


def add(fmu: Path, entry: zipfile.ZipInfo | str, content: bytes = b"x") -> None:
    with zipfile.ZipFile(fmu, "a") as opened:
        opened.writestr(entry, content)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("../evil.txt", "could leave the directory"),
        ("resources/../../../evil.txt", "could leave the directory"),
        ("resources/./evil.txt", "could leave the directory"),
        ("resources//evil.txt", "could leave the directory"),
        ("/tmp/evil.txt", "an absolute path"),
        ("..\\evil.txt", "backslash"),
        ("C:/evil.txt", "colon"),
        ("evil\x1b[2J.txt", "control character"),
        ("evil\u202etxt.exe", "control character"),
    ],
)
def test_a_name_that_leaves_the_directory(
    fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, expected: str
) -> None:
    add(fmu, name)
    why = refusal(fmu, tmp_path, monkeypatch)
    assert expected in why
    assert why.isprintable()


def test_a_name_that_is_cut_at_a_nul(fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    add(fmu, "resources/aXb")
    fmu.write_bytes(fmu.read_bytes().replace(b"resources/aXb", b"resources/a\0b"))
    assert "control character" in refusal(fmu, tmp_path, monkeypatch)


@pytest.mark.parametrize(
    ("kind", "expected"), [(stat.S_IFLNK, "a link"), (stat.S_IFIFO, "neither a file nor a directory")]
)
def test_links_and_devices(
    fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: int, expected: str
) -> None:
    entry = zipfile.ZipInfo("resources/link")
    entry.create_system, entry.external_attr = 3, (kind | 0o777) << 16
    add(fmu, entry, b"/etc/passwd")
    assert expected in refusal(fmu, tmp_path, monkeypatch)


def test_two_files_of_one_name(fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.warns(UserWarning, match="Duplicate name"):
        add(fmu, "modelDescription.xml")
    assert "twice" in refusal(fmu, tmp_path, monkeypatch)


def test_a_directory_that_stands_there_twice(fmu: Path, tmp_path: Path) -> None:
    add(fmu, "extra/")
    with pytest.warns(UserWarning, match="Duplicate name"):
        add(fmu, "extra/")
    archive.unpack(fmu, tmp_path / "out")
    assert (tmp_path / "out" / "extra").is_dir()


def test_an_encrypted_file(fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    add(fmu, "resources/secret")
    content = bytearray(fmu.read_bytes())
    last = content.rindex(b"PK\x01\x02")
    content[last + 8] |= 1  # flags in the central directory
    fmu.write_bytes(content)
    assert "encrypted" in refusal(fmu, tmp_path, monkeypatch)


class TestSizes:
    def declare(self, fmu: Path, name: str, size: int) -> None:
        """Let the central directory state another unpacked size for the file `name`, which comes last."""
        content = bytearray(fmu.read_bytes())
        last = content.rindex(b"PK\x01\x02")
        assert name.encode() in content[last:]
        struct.pack_into("<I", content, last + 24, size)
        fmu.write_bytes(content)

    def test_one_file(self, fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        add(fmu, "resources/large")
        self.declare(fmu, "resources/large", archive.LARGEST_FILE + (1 << 20))
        why = refusal(fmu, tmp_path, monkeypatch)
        assert "'resources/large' has 1025 MiB unpacked, allowed are 1024 MiB" in why

    def test_all_together(self, fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        for name in "abc":
            add(fmu, f"resources/{name}")
            self.declare(fmu, f"resources/{name}", archive.LARGEST_FILE - 1)
        assert "more than 2048 MiB unpacked" in refusal(fmu, tmp_path, monkeypatch)

    def test_a_real_bomb(self, fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(archive, "LARGEST_FILE", 1 << 20)
        with zipfile.ZipFile(fmu, "a", zipfile.ZIP_DEFLATED) as opened:
            opened.writestr("resources/zeros", bytes(8 << 20))  # 8 kB in the archive
        assert "'resources/zeros' has 8 MiB" in refusal(fmu, tmp_path, monkeypatch)

    def test_a_size_that_is_a_lie_is_not_exceeded(self, fmu: Path, tmp_path: Path) -> None:
        with zipfile.ZipFile(fmu, "a", zipfile.ZIP_DEFLATED) as opened:
            opened.writestr("resources/zeros", bytes(8 << 20))
        self.declare(fmu, "resources/zeros", 100)
        with pytest.raises(ScenarioError, match="cannot be unpacked"):
            archive.unpack(fmu, tmp_path / "unpacked")
        assert all(file.stat().st_size < 1 << 20 for file in (tmp_path / "unpacked").rglob("*"))

    def test_the_description(self, fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(archive, "LARGEST_XML", 100)
        assert "'modelDescription.xml' has 0 MiB" in refusal(fmu, tmp_path, monkeypatch)

    def test_many_files(self, fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(archive, "MOST_FILES", 10)
        for index in range(10):
            add(fmu, f"resources/{index}")
        assert "more than 10 files" in refusal(fmu, tmp_path, monkeypatch)


class TestEntities:
    @pytest.mark.parametrize("declaration", [LAUGHS, FILE_OF_THIS_MACHINE, "<!DOCTYPE a>"])
    @pytest.mark.parametrize("model", [SPRING, BALL])
    def test_in_the_description(
        self,
        libraries: dict[str, Path],
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        model: str,
        declaration: str,
    ) -> None:
        edits = {'encoding="UTF-8"?>': f'encoding="UTF-8"?>{declaration}'}
        if "ENTITY" in declaration:
            edits[f'modelName="{model}"'] = 'modelName="&b;"' if declaration is LAUGHS else 'modelName="x"'
        path = build.pack(model, libraries[model], tmp_path / "entities.fmu", edits)
        why = refusal(path, tmp_path, monkeypatch)
        assert "modelDescription.xml has a document type (<!DOCTYPE>), which FMI does not use" in why

    def test_in_the_build_description(
        self, fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        add(fmu, "sources/buildDescription.xml", f'<?xml version="1.0"?>{LAUGHS}<a>&d;</a>'.encode())
        assert "sources/buildDescription.xml has a document type" in refusal(fmu, tmp_path, monkeypatch)

    @pytest.mark.parametrize("encoding", ["utf-7", "utf-16", "utf-32"])
    def test_another_encoding_hides_nothing(
        self, libraries: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, encoding: str
    ) -> None:
        """Two parsers may differ in the encodings that they know."""
        path = tmp_path / "encoded.fmu"
        text = (build.HERE / SPRING / "modelDescription.xml").read_text()
        text = text.replace('encoding="UTF-8"?>', f'encoding="{encoding}"?>{LAUGHS}')
        with zipfile.ZipFile(path, "w") as opened:
            opened.writestr("modelDescription.xml", text.encode(encoding))
            opened.write(libraries[SPRING], f"binaries/linux64/{SPRING}.so")
        assert "modelDescription.xml" in refusal(path, tmp_path, monkeypatch)


class TestTexts:
    @pytest.mark.parametrize(
        ("old", "new", "kind"),
        [
            ('name="x_mm"', 'name="&lt;img src=x onerror=alert(1)&gt;"', "name"),
            ('name="m"', 'name="&lt;script&gt;"', "name"),
            ('name="F"', 'name="F&#10;ERROR nothing"', "name"),
            ('name="F"', 'name="F&#x9b;2J"', "name"),
            ('name="F"', 'name="F&#x202e;"', "name"),
            ('unit="mm"', 'unit="&lt;b&gt;"', "unit"),
        ],
    )
    def test_names_and_units_with_control_characters_or_html(
        self, libraries: dict[str, Path], tmp_path: Path, old: str, new: str, kind: str
    ) -> None:
        path = build.pack(SPRING, libraries[SPRING], tmp_path / "texts.fmu", {old: new})
        with pytest.raises(ScenarioError, match=rf"is refused: the {kind} .* \(line \d+\)") as e:
            _ = FmuEngine("plant", FmuParams(path=path)).ports
        assert str(e.value).isprintable()

    def test_a_description_becomes_one_line(self, libraries: dict[str, Path], tmp_path: Path) -> None:
        edits = {"force on the mass": "force&#10;on&#9;the mass"}
        path = build.pack(SPRING, libraries[SPRING], tmp_path / "texts.fmu", edits)
        engine = FmuEngine("plant", FmuParams(path=path))
        assert any("force on the mass" in port.description for port in engine.ports)
