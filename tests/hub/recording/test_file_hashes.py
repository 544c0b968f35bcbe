import hashlib
import os
from pathlib import Path

import pytest
from pydantic import Field

from hub.participant import Params
from hub.planning.scenario_file import load
from hub.recording.file_hashes import file_hashes
from hub.recording.recording import Recording
from hub.session.launch import launch
from hub.verify import verify
from schemas.errors import TrustError
from schemas.files import has_contents


class Mesh(Params):
    file: Path


class Models(Params):
    model: Path
    meshes: dict[str, Mesh] = Field(default={})
    more: list[Path] = Field(default=[])
    name: str = "a.txt"


def sha256(text):
    return hashlib.sha256(text.encode()).hexdigest()


@pytest.fixture
def directory(tmp_path):
    (tmp_path / "bag").mkdir()
    (tmp_path / "fmu" / "sources").mkdir(parents=True)
    for name in ("a", "b", "unused", "bag/c", "fmu/sources/d"):
        (tmp_path / f"{name}.txt").write_text(name)
    return tmp_path.resolve()


def test_every_path_among_the_parameters_is_hashed_once(directory):
    params = Models(
        model=Path("a.txt"),
        meshes={"one": Mesh(file=directory / "b.txt")},
        more=[Path("bag"), Path("fmu"), Path("./a.txt"), Path("missing.txt")],
    )
    expected = {str(directory / f"{name}.txt"): sha256(name) for name in ("a", "b", "bag/c", "fmu/sources/d")}
    assert file_hashes([params, params], directory) == expected


def test_what_has_changed_or_is_gone(directory):
    paths = [directory / name for name in ("a.txt", "b.txt", "bag")]
    recorded = file_hashes([Models(model=Path("a.txt"), more=paths)], directory).values()
    assert all(has_contents(path, recorded) for path in paths)
    (directory / "a.txt").write_text("other")
    (directory / "bag/c.txt").unlink()
    assert [has_contents(path, recorded) for path in paths] == [False, True, False]


def test_a_directory_with_more_than_was_recorded(directory):
    recorded = file_hashes([Models(model=Path("bag"))], directory).values()
    (directory / "bag" / "more").mkdir()
    assert not has_contents(directory / "bag", recorded)


def test_a_file_with_the_recorded_contents_may_be_elsewhere(directory):
    recorded = file_hashes([Models(model=Path("a.txt"))], directory).values()
    assert has_contents((directory / "a.txt").rename(directory / "bag" / "a.txt"), recorded)


def test_what_is_no_file_has_no_contents(directory):
    os.mkfifo(directory / "pipe")
    (directory / "loop").symlink_to("loop")
    for name in ("pipe", "loop", "a" * 5000, "\0", "missing"):
        assert not has_contents(directory / name, [sha256("")])


PLUGIN = """
from pathlib import Path

from hub.participant import Params, Stepped


class ReaderParams(Params):
    file: Path


class Reader(Stepped):
    params_model = ReaderParams
    ports = ()

    def configure(self, setup):
        self.state = len((setup.directory / self.params.file).read_text())
        return {}

    def step(self, t, h, inputs):
        return {}

    def state_hash(self):
        return self.state

    def close(self):
        pass
"""


def test_a_verification_tells_which_file_is_another_one_by_now(install_plugin, directory, caplog):
    install_plugin("library", {"trocar.engines": {"reader": "library:Reader"}}, text=PLUGIN)
    (directory / "session.yaml").write_text(
        "{name: reading, step: 1 ms, duration: 3 ms, participants: {reader: {kind: reader, file: a.txt}}}"
    )
    launch(load(str(directory / "session.yaml")), record=directory / "recording").run()
    recording = Recording(directory / "recording")
    assert recording.files() == {str(directory / "a.txt"): sha256("a")}
    assert verify(recording).same
    assert "expect differences" not in caplog.text
    (directory / "a.txt").write_text("longer")
    with pytest.raises(TrustError, match=r"asks for .*: the file '.*a\.txt', which is missing or has other"):
        verify(recording)
    assert not verify(recording, trust=True).same
    assert f"file '{directory / 'a.txt'}' has changed or is missing since the recording" in caplog.text
